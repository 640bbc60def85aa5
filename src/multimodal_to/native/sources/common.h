/* What every file of the library shares: exports, instruction sets and the length of a vector.
 *
 * A file named *_kernel.c is compiled once for each instruction set, with one of MT_SET_SSE2, MT_SET_AVX2,
 * MT_SET_AVX512, MT_SET_NEON and MT_SET_PORTABLE defined. It names its functions by MT_KERNEL:
 *
 *     double MT_KERNEL(mt_dot)(int count, const double *a, const double *b) { ... }
 *
 * A file that calls it is compiled once. It declares all variants and takes the one for this processor:
 *
 *     MT_DECLARE(double, mt_dot, (int count, const double *a, const double *b))
 *     ... MT_CHOOSE(mt_dot)(count, a, b) ...
 *
 * compiling.py defines MT_WITH_... for every set that is in the library, in every file.
 */
#ifndef MT_COMMON_H
#define MT_COMMON_H

#if defined(_WIN32)
#define MT_EXPORT __attribute__((dllexport))
#else
#define MT_EXPORT __attribute__((visibility("default")))
#endif

/* The instruction sets, from the smallest up; Python reads these numbers. */
enum { MT_PORTABLE = 0, MT_SSE2 = 1, MT_AVX2 = 2, MT_AVX512 = 3, MT_NEON = 4 };

/* Return the set whose kernels run: the largest one that the library has and the processor and its system support.
 * MULTIMODAL_TO_INSTRUCTION_SET=sse2|avx2|avx512 in the environment asks for a smaller one; it is read once. */
MT_EXPORT int mt_instruction_set(void);

/* In a kernel: the name of a function, and the doubles that a vector register holds. */
#if defined(MT_SET_AVX512)
#define MT_KERNEL(name) name##_avx512
#define MT_LANES 8
#elif defined(MT_SET_AVX2)
#define MT_KERNEL(name) name##_avx2
#define MT_LANES 4
#elif defined(MT_SET_SSE2)
#define MT_KERNEL(name) name##_sse2
#define MT_LANES 2
#elif defined(MT_SET_NEON)
#define MT_KERNEL(name) name##_neon
#define MT_LANES 2
#elif defined(MT_SET_PORTABLE)
#define MT_KERNEL(name) name##_portable
#define MT_LANES 2
#endif

/* In a kernel: a vector register of doubles, and the same for memory that is aligned as a double only. */
#if defined(MT_LANES)
typedef double mt_vector __attribute__((vector_size(8 * MT_LANES)));
typedef double mt_unaligned __attribute__((vector_size(8 * MT_LANES), aligned(8)));
#endif

/* In the file that calls kernels. */
#if defined(MT_WITH_NEON)
#define MT_DECLARE(type, name, arguments) type name##_neon arguments;
#define MT_CHOOSE(name) name##_neon
#elif defined(MT_WITH_PORTABLE)
#define MT_DECLARE(type, name, arguments) type name##_portable arguments;
#define MT_CHOOSE(name) name##_portable
#elif defined(MT_WITH_AVX512) && defined(MT_WITH_AVX2)
#define MT_DECLARE(type, name, arguments) type name##_sse2 arguments; type name##_avx2 arguments; type name##_avx512 arguments;
#define MT_CHOOSE(name) \
  (mt_instruction_set() == MT_AVX512 ? name##_avx512 : mt_instruction_set() == MT_AVX2 ? name##_avx2 : name##_sse2)
#elif defined(MT_WITH_AVX512)
#define MT_DECLARE(type, name, arguments) type name##_sse2 arguments; type name##_avx512 arguments;
#define MT_CHOOSE(name) (mt_instruction_set() == MT_AVX512 ? name##_avx512 : name##_sse2)
#elif defined(MT_WITH_AVX2)
#define MT_DECLARE(type, name, arguments) type name##_sse2 arguments; type name##_avx2 arguments;
#define MT_CHOOSE(name) (mt_instruction_set() == MT_AVX2 ? name##_avx2 : name##_sse2)
#else
#define MT_DECLARE(type, name, arguments) type name##_sse2 arguments;
#define MT_CHOOSE(name) name##_sse2
#endif

#endif
