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

static unsigned saved_registers(void) {
  unsigned low, high;
  __asm__ volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
  (void)high;
  return low;
}

static int has(unsigned word, unsigned bits) { return (word & bits) == bits; }

static int largest_of_the_processor(void) {
  unsigned a, b, c, d;
  if (!__get_cpuid(1, &a, &b, &c, &d) || !has(c, LEAF1_ECX_OSXSAVE | LEAF1_ECX_AVX | LEAF1_ECX_FMA)) return MT_SSE2;
  unsigned saved = saved_registers();
  if (!has(saved, XCR0_YMM) || !__get_cpuid_count(7, 0, &a, &b, &c, &d) || !has(b, LEAF7_EBX_AVX2)) return MT_SSE2;
  if (!has(saved, XCR0_ZMM) || !has(b, LEAF7_EBX_AVX512F | LEAF7_EBX_AVX512DQ | LEAF7_EBX_AVX512VL)) return MT_AVX2;
  return MT_AVX512;
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
  int able = largest_of_the_processor(), asked = asked_for();
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
