/* what the filter asks of libm, where there is none: roots are instructions, the rest is JavaScript's */
#define NAN __builtin_nanf("")
#define INFINITY __builtin_inff()
#define sqrtf __builtin_sqrtf
#define fabsf __builtin_fabsf
__attribute__((import_module("env"), import_name("sinf"))) float sinf(float);
__attribute__((import_module("env"), import_name("cosf"))) float cosf(float);
