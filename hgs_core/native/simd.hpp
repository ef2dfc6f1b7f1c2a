// Vectors of floats by compiler extensions: one source, compiled once per instruction set into its own namespace.
//
// Included only by the variant files, which set HGS_VARIANT. Nothing here may call an inline function of the
// standard library: the linker keeps one copy of each, and it could be the one that this processor cannot run.
#pragma once
#include <cstdint>

#if defined(__AVX2__)
#include <immintrin.h>
#elif defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace hgs::HGS_VARIANT {

#if defined(__AVX512F__)
inline constexpr int LANES = 16;
#elif defined(__AVX2__)
inline constexpr int LANES = 8;
#else
inline constexpr int LANES = 4;
#endif

typedef float VFloat __attribute__((vector_size(4 * LANES)));
typedef std::int32_t VInt __attribute__((vector_size(4 * LANES)));
typedef float VFloat8 __attribute__((vector_size(32), aligned(4), may_alias));
typedef float VFloatMemory __attribute__((vector_size(4 * LANES), aligned(4), may_alias));

typedef std::int32_t VIntMemory __attribute__((vector_size(4 * LANES), aligned(4), may_alias));

#define HGS_INLINE inline __attribute__((always_inline))
#define HGS_LAMBDA __attribute__((always_inline))

HGS_INLINE VFloat load(const float* p) { return *reinterpret_cast<const VFloatMemory*>(p); }
HGS_INLINE void store(float* p, VFloat v) { *reinterpret_cast<VFloatMemory*>(p) = v; }
HGS_INLINE void store(std::int32_t* p, VInt v) { *reinterpret_cast<VIntMemory*>(p) = v; }
HGS_INLINE VInt load(const std::int32_t* p) { return *reinterpret_cast<const VIntMemory*>(p); }
HGS_INLINE VFloat splat_all(float s) { return s - VFloat{}; }

HGS_INLINE VFloat8 load8(const float* p) { return *reinterpret_cast<const VFloat8*>(p); }
HGS_INLINE void store8(float* p, VFloat8 v) { *reinterpret_cast<VFloat8*>(p) = v; }

HGS_INLINE VFloat vmin(VFloat a, VFloat b) {
#if defined(__AVX512F__)
  return _mm512_min_ps(a, b);
#elif defined(__AVX2__)
  return _mm256_min_ps(a, b);
#else
  return a < b ? a : b;
#endif
}

HGS_INLINE VFloat vmax(VFloat a, VFloat b) {
#if defined(__AVX512F__)
  return _mm512_max_ps(a, b);
#elif defined(__AVX2__)
  return _mm256_max_ps(a, b);
#else
  return a > b ? a : b;
#endif
}

HGS_INLINE VFloat vsqrt(VFloat a) {
#if defined(__AVX512F__)
  return _mm512_sqrt_ps(a);
#elif defined(__AVX2__)
  return _mm256_sqrt_ps(a);
#else
  VFloat root{};
  for (int i = 0; i < LANES; ++i) root[i] = __builtin_sqrtf(a[i]);
  return root;
#endif
}

HGS_INLINE VFloat8 vsqrt8(VFloat8 a) {
#if defined(__AVX2__)
  return _mm256_sqrt_ps(a);
#else
  VFloat8 root{};
  for (int i = 0; i < 8; ++i) root[i] = __builtin_sqrtf(a[i]);
  return root;
#endif
}

HGS_INLINE VFloat8 vmin8(VFloat8 a, VFloat8 b) {
#if defined(__AVX2__)
  return _mm256_min_ps(a, b);
#else
  return a < b ? a : b;
#endif
}

HGS_INLINE VFloat8 vmax8(VFloat8 a, VFloat8 b) {
#if defined(__AVX2__)
  return _mm256_max_ps(a, b);
#else
  return a > b ? a : b;
#endif
}

// Whether all lanes are 0.
HGS_INLINE bool all_zero8(VFloat8 a) {
#if defined(__AVX2__)
  return _mm256_movemask_ps(_mm256_cmp_ps(a, _mm256_setzero_ps(), _CMP_NEQ_UQ)) == 0;
#else
  bool zero = true;
  for (int i = 0; i < 8; ++i) zero = zero && a[i] == 0.0f;
  return zero;
#endif
}

// 1 / a for a in [0.01, 1], relative error below 2e-7.
HGS_INLINE VFloat inverse(VFloat a) {
#if defined(__AVX512F__)
  const VFloat rough = _mm512_rcp14_ps(a);
  return rough * (2.0f - a * rough);  // a division of 16 lanes would be what the loop waits for
#else
  return 1.0f / a;
#endif
}

// base[index] in the lanes of the mask, 0 in the others.
HGS_INLINE VFloat gather(const float* base, VInt index, VInt mask) {
#if defined(__AVX512F__)
  const __mmask16 lanes = _mm512_test_epi32_mask((__m512i)mask, (__m512i)mask);
  return _mm512_mask_i32gather_ps(_mm512_setzero_ps(), lanes, (__m512i)index, base, 4);
#elif defined(__AVX2__)
  return _mm256_mask_i32gather_ps(_mm256_setzero_ps(), base, (__m256i)index, (__m256)mask, 4);
#else
  VFloat values{};
  for (int i = 0; i < LANES; ++i) {
    if (mask[i] != 0) values[i] = base[index[i]];
  }
  return values;
#endif
}

// Bit i is set where lane i of the mask is.
HGS_INLINE std::uint32_t lane_bits(VInt mask) {
#if defined(__AVX512F__)
  return _mm512_test_epi32_mask((__m512i)mask, (__m512i)mask);
#elif defined(__AVX2__)
  return static_cast<std::uint32_t>(_mm256_movemask_ps((__m256)mask));
#else
  std::uint32_t bits = 0;
  for (int i = 0; i < LANES; ++i) bits |= mask[i] != 0 ? 1u << i : 0u;
  return bits;
#endif
}

HGS_INLINE bool any(VInt mask) {
#if defined(__AVX512F__)
  return _mm512_test_epi32_mask((__m512i)mask, (__m512i)mask) != 0;
#elif defined(__AVX2__)
  return _mm256_movemask_ps((__m256)mask) != 0;
#else
  std::int32_t either = 0;
  for (int i = 0; i < LANES; ++i) either |= mask[i];
  return either != 0;
#endif
}

// The lowest of the lanes.
HGS_INLINE float lowest(VFloat a) {
#if defined(__AVX512F__)
  return _mm512_reduce_min_ps(a);
#else
  float low = a[0];
  for (int i = 1; i < LANES; ++i) low = a[i] < low ? a[i] : low;
  return low;
#endif
}

HGS_INLINE VInt to_int(VFloat a) { return __builtin_convertvector(a, VInt); }  // towards zero
HGS_INLINE VFloat to_float(VInt a) { return __builtin_convertvector(a, VFloat); }
HGS_INLINE VInt to_cell(VFloat a) {  // towards minus infinity, as far as 2^30; NaN lies in no cell
  const VFloat held = vmin(vmax(a, VFloat{} - 0x1p30f), VFloat{} + 0x1p30f);
  const VInt whole = to_int(held);
  return whole + (to_float(whole) > held);  // a true comparison is -1
}

HGS_INLINE VFloat vabs(VFloat a) { return (VFloat)((VInt)a & 0x7fffffff); }

// A yes or no per lane; AVX-512 keeps these in registers of their own.
#if defined(__AVX512F__)
typedef __mmask16 VMask;
HGS_INLINE VMask at_least(VFloat a, VFloat b) { return _mm512_cmp_ps_mask(a, b, _CMP_GE_OQ); }
HGS_INLINE VMask at_least(VMask among, VFloat a, VFloat b) {
  return _mm512_mask_cmp_ps_mask(among, a, b, _CMP_GE_OQ);
}
HGS_INLINE VFloat where(VMask mask, VFloat a) { return _mm512_maskz_mov_ps(mask, a); }  // 0 elsewhere
HGS_INLINE std::uint32_t mask_bits(VMask mask) { return mask; }
#else
typedef VInt VMask;
HGS_INLINE VMask at_least(VFloat a, VFloat b) { return a >= b; }
HGS_INLINE VMask at_least(VMask among, VFloat a, VFloat b) { return among & (a >= b); }
HGS_INLINE VFloat where(VMask mask, VFloat a) { return (VFloat)((VInt)a & mask); }
HGS_INLINE std::uint32_t mask_bits(VMask mask) { return lane_bits(mask); }
#endif

// Vectors over 4 columns and LANES / 4 rows: lane i lies in column i % 4 and row i / 4.
HGS_INLINE VFloat spread_columns(const float* columns) {
#if defined(__AVX512F__)
  return _mm512_broadcast_f32x4(_mm_loadu_ps(columns));
#elif defined(__AVX2__)
  return _mm256_broadcast_ps(reinterpret_cast<const __m128*>(columns));
#else
  return load(columns);
#endif
}

// Of 4 rows those from `part` * LANES / 4 on.
HGS_INLINE VFloat spread_rows(const float* rows, int part) {
#if defined(__AVX512F__)
  (void)part;
  return _mm512_permutevar_ps(spread_columns(rows),
                              _mm512_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3));
#elif defined(__AVX2__)
  const __m256i first = _mm256_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1);
  return _mm256_permutevar_ps(spread_columns(rows), _mm256_add_epi32(first, _mm256_set1_epi32(2 * part)));
#else
  return splat_all(rows[part]);
#endif
}

#if defined(__AVX2__) && !defined(__AVX512F__)
struct BitLists {
  std::uint8_t of[256][8];  // the set bits of a byte, from the lowest on
};

constexpr BitLists list_bits_of_bytes() {
  BitLists lists{};
  for (int byte = 0; byte < 256; ++byte) {
    int n = 0;
    for (int bit = 0; bit < 8; ++bit) {
      if (byte >> bit & 1) lists.of[byte][n++] = static_cast<std::uint8_t>(bit);
    }
  }
  return lists;
}

inline constexpr BitLists BIT_LISTS = list_bits_of_bytes();

HGS_INLINE int list_byte(std::uint32_t byte, std::uint32_t label, std::uint32_t* out) {
  const __m128i bits = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(BIT_LISTS.of[byte]));
  const __m256i labels = _mm256_add_epi32(_mm256_cvtepu8_epi32(bits), _mm256_set1_epi32(static_cast<int>(label)));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(out), labels);
  return __builtin_popcount(byte);
}
#endif

// Writes label + i for every set bit i of the 16, and maybe more behind them, up to out[15]; returns how many are set.
// Without a branch: which bits are set cannot be predicted.
HGS_INLINE int list_bits(std::uint32_t bits, std::uint32_t label, std::uint32_t* out) {
#if defined(__AVX512F__)
  const __m512i numbers = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  const __m512i labels = _mm512_add_epi32(numbers, _mm512_set1_epi32(static_cast<int>(label)));
  _mm512_storeu_si512(out, _mm512_maskz_compress_epi32(static_cast<__mmask16>(bits), labels));
  return __builtin_popcount(bits);
#elif defined(__AVX2__)
  const int n = list_byte(bits & 0xff, label, out);
  return n + list_byte(bits >> 8, label + 8, out + n);
#else
  int n = 0;
  for (std::uint32_t i = 0; i < 16; ++i) {
    out[n] = label + i;
    n += static_cast<int>(bits >> i & 1);
  }
  return n;
#endif
}

// 2^x, relative error below 2e-7; x is clamped to [-126, 126].
HGS_INLINE VFloat vexp2(VFloat x) {
  x = vmax(vmin(x, splat_all(126.0f)), splat_all(-126.0f));
  const VFloat shifted = x + 12582912.0f;  // 1.5 * 2^23: the integer part lands in the low bits
  const VFloat f = x - (shifted - 12582912.0f);
  VFloat p = f * 1.5403530e-4f + 1.3333558e-3f;
  p = p * f + 9.6181291e-3f;
  p = p * f + 5.5504109e-2f;
  p = p * f + 2.4022651e-1f;
  p = p * f + 6.9314718e-1f;
  p = p * f + 1.0f;
  const VInt exponent = (VInt)shifted << 23;
  return (VFloat)((VInt)p + exponent);
}

// 2^-x for x >= 0, relative error below 3e-7; x is clamped to 126.
HGS_INLINE VFloat vexp2_minus(VFloat x) {
  x = vmin(x, splat_all(126.0f));
  const VFloat shifted = 12582912.0f - x;  // as above
  const VFloat f = x - (12582912.0f - shifted);
  VFloat p = f * -1.3276472e-3f + 9.6755410e-3f;
  p = p * f - 5.5507131e-2f;
  p = p * f + 2.4022120e-1f;
  p = p * f - 6.9314694e-1f;
  p = p * f + 1.0000001f;
  return (VFloat)((VInt)p + ((VInt)shifted << 23));
}

HGS_INLINE VFloat vexp(VFloat x) { return vexp2(x * 1.44269504f); }

// ln(x) for positive normal x, absolute error below 3e-6.
HGS_INLINE VFloat vlog(VFloat x) {
  const VInt bits = (VInt)x;
  const VInt exponent = (bits >> 23) - 127;
  const VFloat m = (VFloat)((bits & 0x7fffff) | 0x3f800000);  // [1, 2)
  const VFloat t = (m - 1.0f) / (m + 1.0f);                   // ln m = 2 (t + t^3/3 + t^5/5 + ...), t < 1/3
  const VFloat t2 = t * t;
  VFloat p = t2 * (1.0f / 11.0f) + 1.0f / 9.0f;
  p = p * t2 + 1.0f / 7.0f;
  p = p * t2 + 0.2f;
  p = p * t2 + 1.0f / 3.0f;
  p = p * t2 + 1.0f;
  return __builtin_convertvector(exponent, VFloat) * 0.69314718f + 2.0f * t * p;
}

// log2(x) for positive normal x, absolute error below 2e-4: for bounds, not for values.
HGS_INLINE VFloat vlog2_rough(VFloat x) {
  const VInt bits = (VInt)x;
  const VInt exponent = (bits >> 23) - 127;
  const VFloat m = (VFloat)((bits & 0x7fffff) | 0x3f800000);  // [1, 2)
  const VFloat t = (m - 1.0f) / (m + 1.0f);                   // log2 m = 2/ln2 (t + t^3/3 + t^5/5 + ...), t < 1/3
  const VFloat t2 = t * t;
  const VFloat series = t * (2.8853901f + t2 * (0.9617967f + t2 * (0.5770780f + t2 * 0.4121986f)));
  return __builtin_convertvector(exponent, VFloat) + series;
}

#if defined(__AVX512F__)
// Lanes that belong together, added: the upper half of `a` to its lower, and the other way round for `b`; by 8, by 2.
HGS_INLINE __m512 fold_halves(__m512 a, __m512 b) {
  return _mm512_add_ps(_mm512_mask_blend_ps(0xff00, a, b), _mm512_shuffle_f32x4(a, b, 0x4e));
}
HGS_INLINE __m512 fold_pairs(__m512 a, __m512 b) {
  const __m512d x = _mm512_castps_pd(a), y = _mm512_castps_pd(b);
  return _mm512_add_ps(_mm512_castpd_ps(_mm512_mask_blend_pd(0xaa, x, y)),
                       _mm512_castpd_ps(_mm512_shuffle_pd(x, y, 0x55)));
}
#endif

// out[k] = sum of the lanes of v[k].
HGS_INLINE void sum_lanes_of_8(const VFloat v[8], float* out) {
#if defined(__AVX512F__)
  const __m512 a = fold_pairs(fold_halves(v[0], v[4]), fold_halves(v[1], v[5]));
  const __m512 b = fold_pairs(fold_halves(v[2], v[6]), fold_halves(v[3], v[7]));
  const __m512 sums = _mm512_add_ps(_mm512_shuffle_ps(a, b, 0x88), _mm512_shuffle_ps(a, b, 0xdd));
  const __m512 even = _mm512_shuffle_f32x4(sums, sums, 0x08), odd = _mm512_shuffle_f32x4(sums, sums, 0x0d);
  _mm256_storeu_ps(out, _mm256_add_ps(_mm512_castps512_ps256(even), _mm512_castps512_ps256(odd)));
#elif defined(__AVX2__)
  const __m256 a = _mm256_hadd_ps(_mm256_hadd_ps(v[0], v[1]), _mm256_hadd_ps(v[2], v[3]));
  const __m256 b = _mm256_hadd_ps(_mm256_hadd_ps(v[4], v[5]), _mm256_hadd_ps(v[6], v[7]));
  const __m256 low = _mm256_permute2f128_ps(a, b, 0x20);
  const __m256 high = _mm256_permute2f128_ps(a, b, 0x31);
  _mm256_storeu_ps(out, _mm256_add_ps(low, high));
#else
  for (int k = 0; k < 8; ++k) {
    float sum = 0.0f;
    for (int i = 0; i < LANES; ++i) sum += v[k][i];
    out[k] = sum;
  }
#endif
}

// The same of four.
HGS_INLINE void sum_lanes_of_4(const VFloat v[4], float* out) {
#if defined(__AVX512F__)
  const __m512 a = fold_pairs(v[0], v[1]), b = fold_pairs(v[2], v[3]);
  const __m512 sums = _mm512_add_ps(_mm512_shuffle_ps(a, b, 0x88), _mm512_shuffle_ps(a, b, 0xdd));
  const __m512 halves = _mm512_add_ps(sums, _mm512_shuffle_f32x4(sums, sums, 0x4e));
  const __m512 quarters = _mm512_add_ps(halves, _mm512_shuffle_f32x4(halves, halves, 0xb1));
  _mm_storeu_ps(out, _mm512_castps512_ps128(quarters));
#elif defined(__AVX2__)
  const __m256 sums = _mm256_hadd_ps(_mm256_hadd_ps(v[0], v[1]), _mm256_hadd_ps(v[2], v[3]));
  _mm_storeu_ps(out, _mm_add_ps(_mm256_castps256_ps128(sums), _mm256_extractf128_ps(sums, 1)));
#else
  for (int k = 0; k < 4; ++k) {
    float sum = 0.0f;
    for (int i = 0; i < LANES; ++i) sum += v[k][i];
    out[k] = sum;
  }
#endif
}

// Denormals become zero while it lives (they slow the arithmetic a hundredfold and mean nothing here).
class FlushDenormals {
 public:
#if defined(__SSE2__)
  FlushDenormals() : saved_(_mm_getcsr()) { _mm_setcsr(saved_ | 0x8040); }
  ~FlushDenormals() { _mm_setcsr(saved_); }

 private:
  unsigned saved_;
#else
  FlushDenormals() {}
  ~FlushDenormals() {}
#endif
};

}  // namespace hgs::HGS_VARIANT
