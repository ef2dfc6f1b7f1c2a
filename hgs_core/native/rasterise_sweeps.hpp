// The loops over one tile: all splats of the tile front to back, and for each the pixels it touches.
// Included only by the variant files (see simd.hpp).
//
// An isotropic splat separates: a = (o 2^(-k dy^2)) 2^(-k dx^2), so a tile costs exponentials per row and per
// column, none per pixel. A backward sweep runs front to back as well: with q_i = dL/dw_i and S = sum_{j > i} q_j w_j
// (the final sum less what has gone by), dL/dalpha_i = T_i q_i - S / (1 - alpha_i): no alphas are stored.
#pragma once
#include "rasterise_workspace.hpp"
#include "simd.hpp"

namespace hgs::HGS_VARIANT {

inline constexpr int VECTORS = TILE_W / LANES;  // per row of a tile
inline constexpr int CHECK_EVERY = 16;          // splats between two looks for rows that have gone opaque

struct Tile {
  float x0, y0;                // centre of its first pixel
  const TileEntry* entries;
  std::uint32_t n_entries;
};

struct RowRange {
  int first, last;  // empty: last < first
};

// What one splat does to one tile, separated into rows and columns.
struct Footprint {
  VFloat dx[VECTORS];   // pixel - splat
  VFloat along[VECTORS];  // 2^(-k dx^2)
  alignas(64) float dy[TILE_H], dy2[TILE_H];
  alignas(64) float down[TILE_H];  // o 2^(-k dy^2)
  int first_row, last_row;  // within reach
  int first_vector, last_vector;
};

HGS_INLINE VFloat lane_numbers() {
  VFloat lanes;
  for (int i = 0; i < LANES; ++i) lanes[i] = static_cast<float>(i);
  return lanes;
}

HGS_INLINE bool trace(const Splat& splat, const Tile& tile, Footprint& footprint) {
  footprint.first_vector = 0;
  footprint.last_vector = -1;
  const float v = splat.v - tile.y0, u = splat.u - tile.x0;
  // `reach` is rounded up by more than the one ulp that "+ 1, then truncate" can lose at whole numbers.
  const float top = v - splat.reach + 1.0f, bottom = v + splat.reach;
  if (!(bottom >= 0.0f) || !(top < TILE_H)) return false;
  footprint.first_row = top > 0.0f ? static_cast<int>(top) : 0;
  footprint.last_row = bottom < TILE_H - 1 ? static_cast<int>(bottom) : TILE_H - 1;
  if constexpr (VECTORS > 1) {
    const float left = u - splat.reach, right = u + splat.reach;
    footprint.first_vector = left > 0.0f ? static_cast<int>(left) / LANES : 0;
    footprint.last_vector = right < TILE_W - 1 ? static_cast<int>(right < 0.0f ? 0.0f : right) / LANES : VECTORS - 1;
  } else {
    footprint.last_vector = 0;
  }
  const VFloat lanes = lane_numbers();
  for (int j = 0; j < VECTORS; ++j) {
    const VFloat dx = lanes + (static_cast<float>(j * LANES) - u);
    footprint.dx[j] = dx;
    footprint.along[j] = vexp2(-splat.falloff * dx * dx);
  }
  for (int j = 0; j < TILE_H / LANES; ++j) {
    const VFloat dy = lanes + (static_cast<float>(j * LANES) - v);
    const VFloat dy2 = dy * dy;
    store(footprint.dy + j * LANES, dy);
    store(footprint.dy2 + j * LANES, dy2);
    store(footprint.down + j * LANES, splat.opacity * vexp2(-splat.falloff * dy2));
  }
  return true;
}

// alpha where the splat counts, else 0.
HGS_INLINE VFloat masked_alpha(VFloat a, VFloat T) {
  const VInt counts = (a >= MIN_ALPHA) & (T >= MIN_TRANSMITTANCE);
  const VFloat alpha = vmin(a, splat_all(MAX_ALPHA));
  return counts ? alpha : VFloat{};
}

// From the first to the last row of the tile in which some pixel still lets light through. `stride`: floats from one
// row of T to the next.
static RowRange open_rows(const float* T, int stride) {
  RowRange open{TILE_H, -1};
  for (int row = 0; row < TILE_H; ++row) {
    VInt through = VInt{};
    for (int j = 0; j < VECTORS; ++j) through = through | (load(T + row * stride + j * LANES) >= MIN_TRANSMITTANCE);
    if (!any(through)) continue;
    if (open.last < 0) open.first = row;
    open.last = row;
  }
  return open;
}

// Calls visit(entry, splat, footprint, rows) for every splat of the tile; `rows` are those within its reach that are
// still open, perhaps none. Returns how many entries were looked at before the tile was opaque.
template <class Visit>
HGS_INLINE std::uint32_t sweep(const Tile& tile, const Splat* splats, const float* T, int stride, Visit&& visit) {
  RowRange open{};
  Footprint footprint;
  for (std::uint32_t i = 0; i < tile.n_entries; ++i) {
    if (i % CHECK_EVERY == 0) {
      open = open_rows(T, stride);
      if (open.last < 0) return i;
    }
    const TileEntry entry = tile.entries[i];
    if (i + 4 < tile.n_entries) __builtin_prefetch(&splats[tile.entries[i + 4].slot]);
    const Splat& splat = splats[entry.slot];
    RowRange rows{0, -1};
    if (trace(splat, tile, footprint)) {
      rows.first = footprint.first_row > open.first ? footprint.first_row : open.first;
      rows.last = footprint.last_row < open.last ? footprint.last_row : open.last;
    }
    visit(entry, splat, footprint, rows);
  }
  return tile.n_entries;
}

// T and the running sums of every pixel of a tile; a row's planes lie together.
enum { T_PLANE, R_PLANE, G_PLANE, B_PLANE, D_PLANE, FORWARD_PLANES };
struct alignas(64) ForwardTile {
  float rows[TILE_H][FORWARD_PLANES][TILE_W];
};

// T = 1 in the image's `width` x `height` pixels of the tile and 0 (opaque) outside.
static void clear(ForwardTile& state, int width, int height) {
  for (int row = 0; row < TILE_H; ++row) {
    for (int plane = 0; plane < FORWARD_PLANES; ++plane) {
      for (int x = 0; x < TILE_W; ++x) state.rows[row][plane][x] = 0.0f;
    }
    for (int x = 0; x < TILE_W && row < height; ++x) state.rows[row][T_PLANE][x] = x < width ? 1.0f : 0.0f;
  }
}

static std::uint32_t sweep_forward(const Tile& tile, const Splat* splats, ForwardTile& state) {
  constexpr int STRIDE = FORWARD_PLANES * TILE_W;
  return sweep(tile, splats, state.rows[0][T_PLANE], STRIDE,
               [&](TileEntry, const Splat& splat, const Footprint& footprint, RowRange rows) HGS_LAMBDA {
    const VFloat red = splat_all(splat.r), green = splat_all(splat.g), blue = splat_all(splat.b);
    const VFloat depth = splat_all(splat.z);
    for (int j = footprint.first_vector; j <= footprint.last_vector; ++j) {
      const VFloat along = footprint.along[j];
      for (int row = rows.first; row <= rows.last; ++row) {
        float* pixel = state.rows[row][0] + j * LANES;
        const VFloat T = load(pixel + T_PLANE * TILE_W);
        const VFloat weight = masked_alpha(footprint.down[row] * along, T) * T;
        store(pixel + T_PLANE * TILE_W, T - weight);
        store(pixel + R_PLANE * TILE_W, load(pixel + R_PLANE * TILE_W) + red * weight);
        store(pixel + G_PLANE * TILE_W, load(pixel + G_PLANE * TILE_W) + green * weight);
        store(pixel + B_PLANE * TILE_W, load(pixel + B_PLANE * TILE_W) + blue * weight);
        store(pixel + D_PLANE * TILE_W, load(pixel + D_PLANE * TILE_W) + depth * weight);
      }
    }
  });
}

// What a pair's eight sums mean after a backward sweep; P = alpha dL/dalpha.
enum { SUM_P, SUM_P_DX, SUM_P_DY, SUM_P_D2, SUM_R, SUM_G, SUM_B, SUM_Z };

// Gradients with respect to C, D and A (dr .. da), T, and S = the part of dL/dw . w still to come.
enum { GT_PLANE, S_PLANE, DR_PLANE, DG_PLANE, DB_PLANE, DD_PLANE, DA_PLANE, GRADIENT_PLANES };
struct alignas(64) GradientTile {
  float rows[TILE_H][GRADIENT_PLANES][TILE_W];
};

static std::uint32_t sweep_backward(const Tile& tile, const Splat* splats, GradientTile& state, float* pair_sums) {
  constexpr int STRIDE = GRADIENT_PLANES * TILE_W;
  return sweep(tile, splats, state.rows[0][GT_PLANE], STRIDE,
               [&](TileEntry entry, const Splat& splat, const Footprint& footprint, RowRange rows) HGS_LAMBDA {
    float* out = pair_sums + 8 * std::size_t{entry.pair};
    VFloat sums[8] = {};
    const VFloat red = splat_all(splat.r), green = splat_all(splat.g), blue = splat_all(splat.b);
    const VFloat depth = splat_all(splat.z);
    for (int j = footprint.first_vector; j <= footprint.last_vector; ++j) {
      const VFloat along = footprint.along[j];
      VFloat p0{}, p1{}, p2{}, r{}, g{}, b{}, z{};  // p1, p2: P dy, P dy^2, by column
      for (int row = rows.first; row <= rows.last; ++row) {
        float* pixel = state.rows[row][0] + j * LANES;
        const VFloat T = load(pixel + GT_PLANE * TILE_W);
        const VFloat a = footprint.down[row] * along;
        const VFloat alpha = masked_alpha(a, T);
        const VFloat weight = alpha * T;
        const VFloat dr = load(pixel + DR_PLANE * TILE_W), dg = load(pixel + DG_PLANE * TILE_W);
        const VFloat db = load(pixel + DB_PLANE * TILE_W), dd = load(pixel + DD_PLANE * TILE_W);
        const VFloat q = (dr * red + dg * green) + (db * blue + (dd * depth + load(pixel + DA_PLANE * TILE_W)));
        const VFloat qw = q * weight;
        const VFloat S = load(pixel + S_PLANE * TILE_W) - qw;
        store(pixel + GT_PLANE * TILE_W, T - weight);
        store(pixel + S_PLANE * TILE_W, S);
        const VFloat P = (a <= MAX_ALPHA) ? qw - S * (alpha * inverse(1.0f - alpha)) : VFloat{};
        p0 += P;
        p1 += P * footprint.dy[row];
        p2 += P * footprint.dy2[row];
        r += dr * weight;
        g += dg * weight;
        b += db * weight;
        z += dd * weight;
      }
      const VFloat Pdx = p0 * footprint.dx[j];
      sums[SUM_P] += p0;
      sums[SUM_P_DX] += Pdx;
      sums[SUM_P_DY] += p1;
      sums[SUM_P_D2] += Pdx * footprint.dx[j] + p2;
      sums[SUM_R] += r;
      sums[SUM_G] += g;
      sums[SUM_B] += b;
      sums[SUM_Z] += z;
    }
    sum_lanes_of_8(sums, out);
  });
}

// What a pair's eight sums mean after a Fisher sweep; E = sum over channels of (alpha dC/dalpha)^2.
enum { SUM_E, SUM_E_XX, SUM_E_XY, SUM_E_YY, SUM_E_XD, SUM_E_YD, SUM_E_DD, SUM_W2 };  // D: d^2

// T, what is still to come of each channel, and the rendered gain.
enum { FT_PLANE, SR_PLANE, SG_PLANE, SB_PLANE, GAIN_PLANE, FISHER_PLANES };
struct alignas(64) FisherTile {
  float rows[TILE_H][FISHER_PLANES][TILE_W];
};

// E at one row of pixels; advances T and the sums to come.
HGS_INLINE VFloat fisher_row(float* pixel, VFloat a, const Splat& splat, VFloat& weight) {
  const VFloat T = load(pixel + FT_PLANE * TILE_W);
  const VFloat alpha = masked_alpha(a, T);
  weight = alpha * T;
  const VFloat ratio = alpha * inverse(1.0f - alpha);
  const VFloat red = splat.r * weight, green = splat.g * weight, blue = splat.b * weight;
  const VFloat sr = load(pixel + SR_PLANE * TILE_W) - red;
  const VFloat sg = load(pixel + SG_PLANE * TILE_W) - green;
  const VFloat sb = load(pixel + SB_PLANE * TILE_W) - blue;
  store(pixel + FT_PLANE * TILE_W, T - weight);
  store(pixel + SR_PLANE * TILE_W, sr);
  store(pixel + SG_PLANE * TILE_W, sg);
  store(pixel + SB_PLANE * TILE_W, sb);
  const VFloat pr = red - sr * ratio, pg = green - sg * ratio, pb = blue - sb * ratio;
  return (a <= MAX_ALPHA) ? pr * pr + pg * pg + pb * pb : VFloat{};
}

static std::uint32_t sweep_fisher(const Tile& tile, const Splat* splats, FisherTile& state, float* pair_sums) {
  constexpr int STRIDE = FISHER_PLANES * TILE_W;
  return sweep(tile, splats, state.rows[0][FT_PLANE], STRIDE,
               [&](TileEntry entry, const Splat& splat, const Footprint& footprint, RowRange rows) HGS_LAMBDA {
    float* out = pair_sums + 8 * std::size_t{entry.pair};
    VFloat sums[8] = {};
    for (int j = footprint.first_vector; j <= footprint.last_vector; ++j) {
      VFloat e0{}, e1{}, e2{}, e3{}, e4{}, w2{};  // e_n: E dy^n, by column
      for (int row = rows.first; row <= rows.last; ++row) {
        VFloat weight;
        const VFloat a = footprint.down[row] * footprint.along[j];
        const VFloat E = fisher_row(state.rows[row][0] + j * LANES, a, splat, weight);
        const float dy = footprint.dy[row];
        const VFloat E1 = E * dy, E2 = E1 * dy, E3 = E2 * dy;
        e0 += E;
        e1 += E1;
        e2 += E2;
        e3 += E3;
        e4 += E3 * dy;
        w2 += weight * weight;
      }
      const VFloat x = footprint.dx[j], xx = x * x;
      sums[SUM_E] += e0;
      sums[SUM_E_XX] += e0 * xx;
      sums[SUM_E_XY] += e1 * x;
      sums[SUM_E_YY] += e2;
      sums[SUM_E_XD] += x * (e0 * xx + e2);
      sums[SUM_E_YD] += e1 * xx + e3;
      sums[SUM_E_DD] += xx * (e0 * xx + 2.0f * e2) + e4;
      sums[SUM_W2] += w2;
    }
    sum_lanes_of_8(sums, out);
  });
}

// Adds to the gain plane, per splat, E c_0 + E (c_1 .. c_6) . (xx, xy, yy, xd, yd, dd) + c_7 w^2.
static void sweep_quality(const Tile& tile, const Splat* splats, FisherTile& state, const float* slot_coefficients) {
  constexpr int STRIDE = FISHER_PLANES * TILE_W;
  sweep(tile, splats, state.rows[0][FT_PLANE], STRIDE,
        [&](TileEntry entry, const Splat& splat, const Footprint& footprint, RowRange rows) HGS_LAMBDA {
    const float* c = slot_coefficients + 8 * std::size_t{entry.slot};
    for (int j = footprint.first_vector; j <= footprint.last_vector; ++j) {
      const VFloat x = footprint.dx[j], xx = x * x;
      for (int row = rows.first; row <= rows.last; ++row) {
        float* pixel = state.rows[row][0] + j * LANES;
        VFloat weight;
        const VFloat E = fisher_row(pixel, footprint.down[row] * footprint.along[j], splat, weight);
        const float y = footprint.dy[row];
        const VFloat d2 = xx + y * y;
        const VFloat form = c[SUM_E] + c[SUM_E_XX] * xx + (c[SUM_E_XY] * y) * x + c[SUM_E_YY] * y * y +
                            d2 * (c[SUM_E_XD] * x + c[SUM_E_YD] * y + c[SUM_E_DD] * d2);
        const VFloat gain = load(pixel + GAIN_PLANE * TILE_W) + E * form + c[SUM_W2] * weight * weight;
        store(pixel + GAIN_PLANE * TILE_W, gain);
      }
    }
  });
}

}  // namespace hgs::HGS_VARIANT
