/* What of libm the exported filter calls; roots and sizes are instructions, sines come from outside */
#define NAN __builtin_nanf("")
#define INFINITY __builtin_inff()
#define sqrtf __builtin_sqrtf
#define fabsf __builtin_fabsf
float sinf(float);
float cosf(float);
