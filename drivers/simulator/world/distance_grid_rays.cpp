// SPDX-License-Identifier: Apache-2.0
// Casts rays against the distance grid, four at a time.
#include <array>
#include <cstring>

#include "drivers/simulator/world/distance_grid.hpp"

namespace plumb::simulated {
namespace {

constexpr float kTolerance = 2e-5F;
// Below 1, because the interpolated distance may be slightly too large.
constexpr float kFree = 0.9F;
// Of a cell. A ray that grazes the surface less deeply than one micrometre (for a radius of 0.1 m)
// may miss it.
constexpr float kLeastStep = 0.25F;
constexpr int kMaxRounds = 4;  // Rounds of false position.
constexpr int kMaxSteps = 200;

// Clips [begin, end] to where the rays are between low and high along one axis.
void Clip(float low, float high, Float4 origin, Float4 direction, Float4& begin, Float4& end) {
  const Float4 inverse = 1.0F / direction;  // An infinity here selects the correct branch below.
  const Float4 a = (low - origin) * inverse;
  const Float4 b = (high - origin) * inverse;
  begin = Larger(Smaller(a, b), begin);
  end = Smaller(Larger(a, b), end);
}

// The values at an index and at the next one, for four indices.
void LoadPairs(const float* values, const std::array<std::size_t, 4>& index, Float4& here,
               Float4& next) {
  std::array<Float4, 2> pairs;
  for (std::size_t i = 0; i < 4; ++i)
    std::memcpy(reinterpret_cast<char*>(pairs.data()) + 8 * i, values + index[i], 8);
  here = __builtin_shufflevector(pairs[0], pairs[1], 0, 2, 4, 6);
  next = __builtin_shufflevector(pairs[0], pairs[1], 1, 3, 5, 7);
}

}  // namespace

inline Float4 DistanceGrid::ValuesAt(Float4 gx, Float4 gy, Float4 gz) const {
  gx = Smaller(Larger(gx, Splat(0.0F)), Splat(last_.x()));
  gy = Smaller(Larger(gy, Splat(0.0F)), Splat(last_.y()));
  gz = Smaller(Larger(gz, Splat(0.0F)), Splat(last_.z()));
  const Int4 ix = __builtin_convertvector(gx, Int4);
  const Int4 iy = __builtin_convertvector(gy, Int4);
  const Int4 iz = __builtin_convertvector(gz, Int4);
  const Float4 x = gx - __builtin_convertvector(ix, Float4);
  const Float4 y = gy - __builtin_convertvector(iy, Float4);
  const Float4 z = gz - __builtin_convertvector(iz, Float4);
  std::array<std::size_t, 4> index{};
  for (int i = 0; i < 4; ++i) index[static_cast<std::size_t>(i)] = Index(ix[i], iy[i], iz[i]);
  const auto along_x = [&](std::size_t offset) {
    Float4 here;
    Float4 next;
    LoadPairs(values_.data() + offset, index, here, next);
    return here + x * (next - here);
  };
  const Float4 v00 = along_x(0);
  const Float4 v10 = along_x(row_);
  const Float4 v01 = along_x(slice_);
  const Float4 v11 = along_x(slice_ + row_);
  const Float4 v0 = v00 + y * (v10 - v00);
  const Float4 v1 = v01 + y * (v11 - v01);
  return v0 + z * (v1 - v0);
}

Float4 DistanceGrid::Intersect(const Vector3x4& origin, const Vector3x4& direction, Float4 t,
                               Float4 t_end) const {
  Clip(box_.min().x(), box_.max().x(), origin.x, direction.x, t, t_end);
  Clip(box_.min().y(), box_.max().y(), origin.y, direction.y, t, t_end);
  Clip(box_.min().z(), box_.max().z(), origin.z, direction.z, t, t_end);
  Float4 found = Splat(kInfinity);
  Int4 active = t < t_end;
  if (!Any(active)) return found;
  t = active ? t : Splat(0.0F);

  // The rays in units of cells.
  const Vector3x4 o{(origin.x - box_.min().x()) * inverse_spacing_,
                    (origin.y - box_.min().y()) * inverse_spacing_,
                    (origin.z - box_.min().z()) * inverse_spacing_};
  const Vector3x4 way{direction.x * inverse_spacing_, direction.y * inverse_spacing_,
                      direction.z * inverse_spacing_};
  const auto distances = [&](Float4 at) {
    return ValuesAt(o.x + at * way.x, o.y + at * way.y, o.z + at * way.z);
  };

  // The surface is after t (outside, at distance d) and, once `bracketed`, before t + width, where
  // the distance is d_far <= tolerance.
  Float4 d = distances(t);
  const Int4 at_once = active & (d <= kTolerance);
  found = at_once ? t : found;
  active &= ~at_once;
  Float4 slope = Splat(0.5F);  // Decrease of the distance per length of the last step.
  const float least_step = kLeastStep * spacing_;
  Int4 careful{0, 0, 0, 0};  // The last step was too long.
  Float4 width = Splat(0.0F);
  Float4 d_far = Splat(0.0F);
  Int4 bracketed{0, 0, 0, 0};
  Int4 rounds{0, 0, 0, 0};
  for (int step = 0; step < kMaxSteps && Any(active); ++step) {
    // Over-relaxed (Keinert et al. 2014): the step is as long as the free balls around both ends
    // still overlap, if the distance continues to decrease as before.
    const Float4 safe = Larger(kFree * d, Splat(least_step));
    Float4 advance =
        careful ? safe : Larger(1.9F * kFree * d / Larger(1.0F + slope, Splat(0.5F)), safe);
    // Near the surface the distance decreases linearly along the ray: try to step across it.
    const Float4 across = 1.2F * d / Larger(slope, Splat(0.05F)) + kTolerance;
    const Int4 tries = (d <= spacing_) & (slope >= 0.05F) & (across <= spacing_) &
                       (t + across < t_end) & ~bracketed & ~careful;
    advance = tries ? across : advance;
    advance =
        bracketed ? width * d / (d - Smaller(d_far, Splat(0.0F))) : advance;  // False position.
    active &= (t + safe < t_end) | bracketed;
    advance = Smaller(advance, t_end - t);
    const Float4 d_next = distances(t + advance);

    const Int4 overlap =
        (kFree * (d + (d_next < 0.0F ? -d_next : d_next)) >= advance) | (advance <= safe);
    const Int4 inside = bracketed | tries ? d_next <= 0.0F : (d_next <= kTolerance) & overlap;
    const Int4 outside = ~inside & (bracketed | (~tries & overlap));
    careful = ~inside & ~outside;
    rounds -= bracketed;
    width = inside ? advance : bracketed ? width - advance : width;
    d_far = inside ? d_next : d_far;
    slope = outside ? (d - d_next) / advance : slope;
    t = outside ? t + advance : t;
    d = outside ? d_next : d;

    bracketed |= inside;
    const Int4 done = active & bracketed &
                      ((rounds == kMaxRounds) | ((d_next <= kTolerance) & (d_next >= -kTolerance)));
    found = done ? t + width * d / (d - Smaller(d_far, Splat(0.0F))) : found;
    active &= ~done;
  }
  return found;
}

float DistanceGrid::Intersect(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction,
                              float t_begin, float t_end) const {
  return Intersect(Splat(origin), Splat(direction), Splat(t_begin), Splat(t_end))[0];
}

}  // namespace plumb::simulated
