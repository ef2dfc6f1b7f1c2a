// The inner loop of the z-buffer: LANES pixels of a row against one triangle.
// Included only by the variant files (see simd.hpp).
#pragma once
#include "simd.hpp"
#include "triangle_raster.hpp"

namespace hgs::HGS_VARIANT {

typedef std::uint32_t FourFlags __attribute__((aligned(1), may_alias));

// Two triangles share an edge with its sign turned, so no pixel falls between them, however the products are rounded.
HGS_INLINE void fill_row(const RasterRows& rows, std::int32_t chosen, int row, float* inverse_depth,
                         std::int32_t* nearest) {
  const DirectionTriangle& t = rows.triangles[chosen];
  const float y = rows.rows[row];
  float at_row[3];
  for (int i = 0; i < 3; ++i) at_row[i] = t.inside[i][1] * y + t.inside[i][2];
  const float depth_at_row = t.inverse_depth[1] * y + t.inverse_depth[2];
  const std::uint8_t* wanted = rows.wanted == nullptr ? nullptr : rows.wanted + std::ptrdiff_t{1} * row * rows.stride;
  for (int column = t.first_column / LANES * LANES; column <= t.last_column; column += LANES) {
    if (wanted != nullptr) {
      std::uint32_t some = 0;
      for (int i = 0; i < LANES; i += 4) some |= *reinterpret_cast<const FourFlags*>(wanted + column + i);
      if (some == 0) continue;
    }
    const VFloat x = load(rows.columns + column);
    const VFloat a = x * t.inside[0][0] + at_row[0];
    const VFloat b = x * t.inside[1][0] + at_row[1];
    const VFloat c = x * t.inside[2][0] + at_row[2];
    const VFloat depth = x * t.inverse_depth[0] + depth_at_row;
    const VFloat before = load(inverse_depth + column);
    const VInt shown = (vmin(vmin(a, b), c) >= 0.0f) & (depth > before);
    if (!any(shown)) continue;
    store(inverse_depth + column, shown ? depth : before);
    store(nearest + column, shown ? VInt{} + chosen : load(nearest + column));
  }
}

static void fill_rows(const RasterRows& rows, float* inverse_depth, std::int32_t* nearest) {
  const std::int64_t n = std::int64_t{1} * (rows.last - rows.first) * rows.stride;
  for (std::int64_t i = 0; i < n; i += LANES) {
    store(inverse_depth + i, VFloat{});
    store(nearest + i, VInt{} - 1);
  }
  for (std::int64_t k = 0; k < rows.n_chosen; ++k) {
    const DirectionTriangle& t = rows.triangles[rows.chosen[k]];
    const int first = t.first_row > rows.first ? t.first_row : rows.first;
    const int last = t.last_row < rows.last - 1 ? t.last_row : rows.last - 1;
    for (int row = first; row <= last; ++row) {
      const std::int64_t start = std::int64_t{1} * (row - rows.first) * rows.stride;
      fill_row(rows, rows.chosen[k], row, inverse_depth + start, nearest + start);
    }
  }
}

}  // namespace hgs::HGS_VARIANT
