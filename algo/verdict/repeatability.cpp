// SPDX-License-Identifier: Apache-2.0
#include "algo/verdict/repeatability.hpp"

#include <algorithm>
#include <cmath>

#include "words/repeat.hpp"

namespace plumb {
namespace {

/// Above this a scan carries a warning (algo/diagnosis), which a fit sensor must not have.
constexpr double kMostChi2PerTerm = 2.0;
/// A unit whose intervals hold in 95 % fails this test in at most one of twenty series of sweeps.
constexpr double kLeastChance = 0.05;
constexpr double kMissProbability = 0.05;

/// Probability of at least `misses` among `count` independent intervals of 95 %.
double ChanceOfMisses(int misses, int count) {
  double fewer = 0.0, term = std::pow(1 - kMissProbability, count);
  for (int i = 0; i < misses; ++i) {
    fewer += term;
    term *= kMissProbability / (1 - kMissProbability) * (count - i) / (i + 1);
  }
  return 1.0 - fewer;
}

void AddPairReason(const std::vector<RepeatedSweep>& sweeps, const RepeatedPair& pair,
                   std::vector<Message>& reasons) {
  const std::string &a = sweeps.at(pair.reference).name, &b = sweeps.at(pair.current).name;
  if (pair.verdict == Verdict::kNoAnswer)
    reasons.push_back(say::repeat::NoAnswer(
        a, b, pair.reasons.empty() ? say::repeat::Unknown() : pair.reasons.front()));
  if (pair.verdict == Verdict::kMove) reasons.push_back(say::repeat::FalseMove(a, b));
}

}  // namespace

Repeatability JudgeRepeats(const std::vector<RepeatedSweep>& sweeps,
                           const std::vector<RepeatedPair>& pairs) {
  Repeatability judged;
  for (std::size_t number = 0; number < judged.scatter.size(); ++number) {
    double sum = 0.0;
    int count = 0;
    for (const RepeatedPair& pair : pairs) {
      const auto& measured = pair.numbers[number];
      if (!measured || !std::isfinite(measured->value)) continue;
      sum += measured->value * measured->value;
      ++count;
      ++judged.judged;
      judged.held += std::abs(measured->value) <= measured->u95 ? 1 : 0;
    }
    if (count > 0) judged.scatter[number] = std::sqrt(sum / count / 2);
  }
  for (const RepeatedPair& pair : pairs) AddPairReason(sweeps, pair, judged.reasons);
  for (const RepeatedSweep& sweep : sweeps) {
    if (sweep.chi2_per_term && !(*sweep.chi2_per_term <= kMostChi2PerTerm))
      judged.reasons.push_back(
          say::repeat::Calibration(sweep.name, *sweep.chi2_per_term, kMostChi2PerTerm));
  }
  // The pairs of n sweeps hold no more than n - 1 independent differences.
  const auto differences = std::min(pairs.size(), sweeps.empty() ? 0 : sweeps.size() - 1);
  const int independent = 6 * static_cast<int>(differences);
  if (judged.judged > 0 && independent > 0) {
    const double missed = static_cast<double>(judged.judged - judged.held) / judged.judged;
    const int misses = static_cast<int>(std::lround(missed * independent));
    if (ChanceOfMisses(misses, independent) < kLeastChance)
      judged.reasons.push_back(say::repeat::Intervals(judged.held, judged.judged));
  } else {
    judged.reasons.push_back(say::repeat::NoNumbers());
  }
  return judged;
}

}  // namespace plumb
