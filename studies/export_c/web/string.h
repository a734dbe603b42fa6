/* The compiler puts instructions or loops in their place */
#define memcpy __builtin_memcpy
#define memset __builtin_memset
