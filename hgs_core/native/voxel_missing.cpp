// Which voxels are missing: unobserved, with a free face-neighbour, looked at in vain fewer than
// `max_attempts` times, in 26-connected clusters of at least `min_cluster`.
//
// A voxel is a candidate by its own column and the four beside it. Whether a cluster of candidates is too small can
// only change for clusters, before or after, of fewer than m = `min_cluster` voxels that touch a changed candidate:
// their voxels lie less than m from it. So the answer is renewed within m columns of the change. A cluster that
// begins there and leaves the columns within 2 m of the change has more than m voxels: nothing beyond is looked at.
#include <algorithm>
#include <vector>

#include "voxel_kernels.hpp"

namespace hgs {
namespace {

ColumnBox grown(const ColumnBox& box, std::int64_t by, const Grid& grid) {
  ColumnBox wider;
  for (std::size_t a = 0; a < 2; ++a) {
    wider.low[a] = std::max<std::int64_t>(box.low[a] - by, 0);
    wider.high[a] = std::min(box.high[a] + by, grid.shape[a]);
  }
  return wider;
}

// The candidates among the columns of a box.
class Candidates {
 public:
  Candidates(const Grid& grid, const std::uint8_t* states, const std::uint8_t* attempts, std::uint8_t max_attempts,
             const ColumnBox& box)
      : box_(box), n_y_(box.high[1] - box.low[1]), n_z_(grid.shape[2]) {
    const auto [nx, ny, nz] = grid.shape;
    flags_.resize(static_cast<std::size_t>((box.high[0] - box.low[0]) * n_y_ * n_z_));
    const std::vector<std::uint8_t> outside(static_cast<std::size_t>(nz), kUnobserved);
#pragma omp parallel for schedule(static)
    for (std::int64_t i = box.low[0]; i < box.high[0]; ++i) {
      for (std::int64_t j = box.low[1]; j < box.high[1]; ++j) {
        const std::int64_t column = grid.offset({i, j, 0});
        const std::uint8_t* here = states + column;
        const std::uint8_t* tried = attempts + column;
        const std::uint8_t* left = i > 0 ? here - ny * nz : outside.data();
        const std::uint8_t* right = i + 1 < nx ? here + ny * nz : outside.data();
        const std::uint8_t* before = j > 0 ? here - nz : outside.data();
        const std::uint8_t* behind = j + 1 < ny ? here + nz : outside.data();
        std::uint8_t* flags = &flags_[index(i, j, 0)];
        const auto beside_free = [&](std::int64_t k) {
          return (left[k] == kFree) | (right[k] == kFree) | (before[k] == kFree) | (behind[k] == kFree);
        };
        const auto wanted = [&](std::int64_t k) { return (here[k] == kUnobserved) & (tried[k] < max_attempts); };
        for (std::int64_t k = 1; k + 1 < nz; ++k) {
          flags[k] = wanted(k) & (beside_free(k) | (here[k - 1] == kFree) | (here[k + 1] == kFree));
        }
        for (const std::int64_t k : {std::int64_t{0}, nz - 1}) {
          const bool below = k > 0 && here[k - 1] == kFree, above = k + 1 < nz && here[k + 1] == kFree;
          flags[k] = wanted(k) & (beside_free(k) | below | above);
        }
      }
    }
  }

  // The candidates of column (i, j), from the floor up.
  std::uint8_t* column(std::int64_t i, std::int64_t j) { return &flags_[index(i, j, 0)]; }

  // Floods the cluster of a voxel and sets its flags to kLarge or kSmall.
  void settle(const Cell& seed, std::int64_t min_cluster) {
    cluster_.assign(1, seed);
    flags_[index(seed[0], seed[1], seed[2])] = kLarge;
    for (std::size_t next = 0; next < cluster_.size(); ++next) {
      const Cell c = cluster_[next];
      for (std::int64_t x = std::max(c[0] - 1, box_.low[0]); x <= std::min(c[0] + 1, box_.high[0] - 1); ++x) {
        for (std::int64_t y = std::max(c[1] - 1, box_.low[1]); y <= std::min(c[1] + 1, box_.high[1] - 1); ++y) {
          for (std::int64_t z = std::max<std::int64_t>(c[2] - 1, 0); z <= std::min(c[2] + 1, n_z_ - 1); ++z) {
            std::uint8_t& flag = flags_[index(x, y, z)];
            if (flag != kCandidate) continue;
            flag = kLarge;
            cluster_.push_back({x, y, z});
          }
        }
      }
    }
    if (static_cast<std::int64_t>(cluster_.size()) >= min_cluster) return;
    for (const Cell& c : cluster_) flags_[index(c[0], c[1], c[2])] = kSmall;
  }

  enum : std::uint8_t { kNone = 0, kCandidate = 1, kLarge = 2, kSmall = 3 };

 private:
  std::size_t index(std::int64_t i, std::int64_t j, std::int64_t k) const {
    return static_cast<std::size_t>(((i - box_.low[0]) * n_y_ + j - box_.low[1]) * n_z_ + k);
  }

  ColumnBox box_;
  std::int64_t n_y_, n_z_;
  std::vector<std::uint8_t> flags_;
  std::vector<Cell> cluster_;
};

}  // namespace

std::int64_t renew_missing(const Grid& grid, const std::uint8_t* states, const std::uint8_t* attempts,
                           std::uint8_t max_attempts, std::int64_t min_cluster, const ColumnBox& box, bool* missing,
                           std::int32_t* in_columns) {
  const std::int64_t ny = grid.shape[1], nz = grid.shape[2];
  const ColumnBox renewed = grown(box, min_cluster, grid);
  Candidates candidates(grid, states, attempts, max_attempts, grown(box, 2 * min_cluster, grid));
  std::int64_t growth = 0;
  for (std::int64_t i = renewed.low[0]; i < renewed.high[0]; ++i) {
    for (std::int64_t j = renewed.low[1]; j < renewed.high[1]; ++j) {
      const std::uint8_t* flags = candidates.column(i, j);
      bool* out = missing + grid.offset({i, j, 0});
      std::int32_t n = 0;
      for (std::int64_t k = 0; k < nz; ++k) {
        if (flags[k] == Candidates::kCandidate) candidates.settle({i, j, k}, min_cluster);
        out[k] = flags[k] == Candidates::kLarge;
        n += out[k];
      }
      std::int32_t& known = in_columns[i * ny + j];
      growth += n - known;
      known = n;
    }
  }
  return growth;
}

}  // namespace hgs
