// SPDX-License-Identifier: Apache-2.0
#include "algo/markers/sweep_tone.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <tbb/parallel_for.h>

#include "algo/base/check_stop.hpp"
#include "algo/base/statistics.hpp"

namespace plumb {
namespace {

constexpr double kMinSide_px = 28.0;       // Edges of smaller markers are too close to each other.
constexpr std::size_t kMaxSightings = 96;  // Limits the time that is spent.
constexpr std::size_t kMinSightings = 8;
constexpr double kFirstGamma = 0.8;
constexpr double kGammaStep = 0.2;
constexpr std::size_t kNumGammas = 13;  // Up to 3.2.
constexpr std::size_t kNumGroups = 4;

double ShortestSide(const ImageCorners& corners) {
  double shortest = 1e9;
  for (std::size_t i = 0; i < 4; ++i)
    shortest = std::min(shortest, (corners[(i + 1) % 4] - corners[i]).norm());
  return shortest;
}

// Evenly spread over the sightings that are large enough.
std::vector<const MarkerSighting*> Chosen(const std::vector<MarkerSighting>& sightings) {
  std::vector<const MarkerSighting*> large;
  for (const MarkerSighting& sighting : sightings)
    if (ShortestSide(sighting.corners) >= kMinSide_px) large.push_back(&sighting);
  if (large.size() <= kMaxSightings) return large;
  std::vector<const MarkerSighting*> chosen;
  for (std::size_t i = 0; i < kMaxSightings; ++i)
    chosen.push_back(large[i * large.size() / kMaxSightings]);
  return chosen;
}

using Losses = std::array<double, kNumGammas>;
using Tables = std::array<ToneTable, kNumGammas>;

// Curves to try: the first of them, the end, and the distance between two.
struct Curves {
  std::size_t first = 0, end = kNumGammas, step = 1;
};

// Logarithm of the residual for each curve, so that a sighting counts by how much a curve improves
// it, not by how badly it fits. Nothing if one of the fits fails.
std::optional<Losses> LossesOf(const MarkerSighting& sighting, const Tables& tables,
                               const Curves& curves) {
  Losses losses{};
  for (std::size_t g = curves.first; g < curves.end; g += curves.step) {
    CornerRefinementOptions options;
    options.tone = &tables[g];
    const auto fit = RefineCorners(sighting.gray, sighting.corners, sighting.pattern, options);
    if (!fit || !(fit->residual_levels > 0)) return std::nullopt;
    losses[g] = std::log(fit->residual_levels);
  }
  return losses;
}

// Of every `stride`-th sighting.
std::vector<Losses> LossesOfAll(const std::vector<const MarkerSighting*>& sightings,
                                std::size_t stride, const Tables& tables, const Curves& curves,
                                const std::stop_token& stop) {
  std::vector<std::optional<Losses>> all((sightings.size() + stride - 1) / stride);
  tbb::parallel_for(std::size_t{0}, all.size(), [&](std::size_t i) {
    CheckStop(stop);
    all[i] = LossesOf(*sightings[i * stride], tables, curves);
  });
  std::vector<Losses> losses;
  for (const auto& one : all)
    if (one) losses.push_back(*one);
  return losses;
}

// Sum over every `stride`-th sighting.
Losses Sum(const std::vector<Losses>& losses, std::size_t first, std::size_t stride) {
  Losses sum{};
  for (std::size_t i = first; i < losses.size(); i += stride)
    for (std::size_t g = 0; g < kNumGammas; ++g) sum[g] += losses[i][g];
  return sum;
}

std::size_t Smallest(const Losses& sum, const Curves& curves) {
  std::size_t best = curves.first;
  for (std::size_t g = curves.first; g < curves.end; g += curves.step)
    if (sum[g] < sum[best]) best = g;
  return best;
}

// The curves about the best of every second one, which is found from a few sightings, because each
// curve costs as much time as a fit of all corners does.
Curves Nearest(const std::vector<const MarkerSighting*>& sightings, const Tables& tables,
               const std::stop_token& stop) {
  constexpr std::size_t kOneIn = 4;
  constexpr std::size_t kReach = 2;
  const Curves every_second{.step = 2};
  const std::vector<Losses> losses = LossesOfAll(sightings, kOneIn, tables, every_second, stop);
  if (losses.empty()) return {};
  const std::size_t best = Smallest(Sum(losses, 0, 1), every_second);
  return {.first = best - std::min(best, kReach), .end = std::min(kNumGammas, best + kReach + 1)};
}

// Position of the smallest sum, by a parabola through it and its neighbours.
double BestGamma(const Losses& sum, const Curves& curves) {
  const std::size_t best = Smallest(sum, curves);
  double place = static_cast<double>(best);
  if (best > curves.first && best + 1 < curves.end) {
    const double bend = sum[best - 1] - 2 * sum[best] + sum[best + 1];
    if (bend > 0) place += 0.5 * (sum[best - 1] - sum[best + 1]) / bend;
  }
  return kFirstGamma + kGammaStep * place;
}

// Median over the sightings, with its standard deviation from their spread.
void FindEdgeShift(const std::vector<const MarkerSighting*>& sightings, SweepTone& tone) {
  std::vector<std::optional<double>> all(sightings.size());
  tbb::parallel_for(std::size_t{0}, sightings.size(), [&](std::size_t i) {
    CornerRefinementOptions options;
    options.tone = &tone.table;
    options.find_edge_shift = true;
    const MarkerSighting& sighting = *sightings[i];
    if (const auto fit = RefineCorners(sighting.gray, sighting.corners, sighting.pattern, options))
      all[i] = fit->edge_shift_px;
  });
  std::vector<double> shifts;
  for (const auto& one : all)
    if (one) shifts.push_back(*one);
  if (shifts.size() < kMinSightings) return;
  tone.edge_shift_px = TakeQuantile(shifts, 0.5);
  // The standard deviation of a median is 1.25 times that of a mean; quartiles are 1.35 sigma
  // apart.
  const double quartiles = TakeQuantile(shifts, 0.75) - TakeQuantile(shifts, 0.25);
  tone.sigma_edge_shift_px =
      1.25 * quartiles / 1.35 / std::sqrt(static_cast<double>(shifts.size()));
}

}  // namespace

std::optional<SweepTone> EstimateTone(const std::vector<MarkerSighting>& sightings,
                                      const std::stop_token& stop) {
  const std::vector<const MarkerSighting*> chosen = Chosen(sightings);
  if (chosen.size() < kMinSightings) return std::nullopt;
  Tables tables;
  for (std::size_t g = 0; g < kNumGammas; ++g)
    tables[g] = PowerTone(kFirstGamma + kGammaStep * static_cast<double>(g));
  Curves curves = Nearest(chosen, tables, stop);
  std::vector<Losses> losses = LossesOfAll(chosen, 1, tables, curves, stop);
  const std::size_t best = Smallest(Sum(losses, 0, 1), curves);
  if ((best == curves.first && best > 0) || (best + 1 == curves.end && best + 1 < kNumGammas)) {
    // The few sightings have misled: the best curve may be any.
    curves = {};
    losses = LossesOfAll(chosen, 1, tables, curves, stop);
  }
  if (losses.size() < kMinSightings) return std::nullopt;
  SweepTone tone;
  tone.gamma = BestGamma(Sum(losses, 0, 1), curves);
  double square = 0;
  for (std::size_t group = 0; group < kNumGroups; ++group)
    square += std::pow(BestGamma(Sum(losses, group, kNumGroups), curves) - tone.gamma, 2);
  tone.sigma_gamma = std::sqrt(square / (kNumGroups * (kNumGroups - 1)));
  tone.table = PowerTone(tone.gamma);
  FindEdgeShift(chosen, tone);
  return tone;
}

}  // namespace plumb
