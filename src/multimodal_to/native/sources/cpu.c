/* What the processor can do, asked of the processor itself by CPUID and XGETBV.
 *
 * Intel, Software Developer's Manual, volume 1, chapters 14.3 and 15.2: AVX may be used where CPUID.1:ECX has OSXSAVE
 * and AVX, and XCR0 says that the system saves the registers XMM and YMM (bits 1 and 2); AVX-512 where it saves the mask
 * registers and ZMM too (bits 5 to 7). __builtin_cpu_supports is not asked: under ziglang it says no to everything.
 */
#include "common.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#if defined(__x86_64__)
#include <cpuid.h>

enum {
  LEAF1_ECX_FMA = 1 << 12,
  LEAF1_ECX_OSXSAVE = 1 << 27,
  LEAF1_ECX_AVX = 1 << 28,
  LEAF7_EBX_AVX2 = 1 << 5,
  LEAF7_EBX_AVX512F = 1 << 16,
  LEAF7_EBX_AVX512DQ = 1 << 17,
  XCR0_YMM = 0x06,
  XCR0_ZMM = 0xe6,
};
#define LEAF7_EBX_AVX512VL (1u << 31)

static int has(unsigned word, unsigned bits) { return (word & bits) == bits; }

/* Return the largest set by what CPUID says of its leaves 1 and 7, and the register XCR0 where there is one. */
MT_EXPORT int mt_set_of_processor(unsigned leaf1_ecx, unsigned leaf7_ebx, unsigned xcr0) {
  if (!has(leaf1_ecx, LEAF1_ECX_OSXSAVE | LEAF1_ECX_AVX | LEAF1_ECX_FMA)) return MT_SSE2;
  if (!has(xcr0, XCR0_YMM) || !has(leaf7_ebx, LEAF7_EBX_AVX2)) return MT_SSE2;
  if (!has(xcr0, XCR0_ZMM)) return MT_AVX2;
  return has(leaf7_ebx, LEAF7_EBX_AVX512F | LEAF7_EBX_AVX512DQ | LEAF7_EBX_AVX512VL) ? MT_AVX512 : MT_AVX2;
}

static unsigned read_xcr0(void) {
  unsigned low, high;
  __asm__ volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
  (void)high;
  return low;
}

static int largest_of_this_processor(void) {
  unsigned a, b, c1, d, b7 = 0, c7;
  if (!__get_cpuid(1, &a, &b, &c1, &d)) return MT_SSE2;
  if (!__get_cpuid_count(7, 0, &a, &b7, &c7, &d)) b7 = 0;
  return mt_set_of_processor(c1, b7, has(c1, LEAF1_ECX_OSXSAVE) ? read_xcr0() : 0);
}

static int asked_for(void) {
  const char *name = getenv("MULTIMODAL_TO_INSTRUCTION_SET");
  if (name && strcmp(name, "sse2") == 0) return MT_SSE2;
  if (name && strcmp(name, "avx2") == 0) return MT_AVX2;
  return MT_AVX512;
}

static int in_the_library(int set) {
#if !defined(MT_WITH_AVX512)
  if (set == MT_AVX512) set = MT_AVX2;
#endif
#if !defined(MT_WITH_AVX2)
  if (set == MT_AVX2) set = MT_SSE2;
#endif
  return set;
}

static int find(void) {
  int able = largest_of_this_processor(), asked = asked_for();
  return in_the_library(asked < able ? asked : able);
}
#elif defined(MT_WITH_NEON)
static int find(void) { return MT_NEON; } /* every 64-bit Arm processor has it */
#else
static int find(void) { return MT_PORTABLE; }
#endif

int mt_instruction_set(void) {
  static _Atomic int found = -1; /* two threads that come first find the same */
  int set = atomic_load_explicit(&found, memory_order_relaxed);
  if (set < 0) atomic_store_explicit(&found, set = find(), memory_order_relaxed);
  return set;
}
