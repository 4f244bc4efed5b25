// SPDX-License-Identifier: Apache-2.0
#include "daemon/result/measured_repeats.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/message_json.hpp"
#include "daemon/result/result_folder.hpp"

namespace plumb {
namespace {

RepeatedPair PairOf(std::size_t reference, std::size_t current, const Comparison& comparison) {
  RepeatedPair pair{.reference = reference,
                    .current = current,
                    .verdict = comparison.verdict,
                    .reasons = comparison.reasons};
  const StoredResult result = Stored(comparison);
  if (!result.correction) return pair;
  for (std::size_t i = 0; i < pair.numbers.size(); ++i) {
    const auto &value = result.correction->value[i], &u95 = result.correction->u95[i];
    if (value && u95) pair.numbers[i] = MeasuredNumber{.value = *value, .u95 = *u95, .words = {}};
  }
  return pair;
}

}  // namespace

MeasuredRepeats MeasureRepeats(const std::vector<Scene>& scenes,
                               const std::vector<std::string>& names,
                               const CompareOptions& options) {
  MeasuredRepeats repeats;
  for (std::size_t i = 0; i < scenes.size(); ++i)
    repeats.sweeps.push_back(
        {.name = names.at(i), .chi2_per_term = scenes[i].calibration_chi2_per_term});
  for (std::size_t a = 0; a < scenes.size(); ++a)
    for (std::size_t b = a + 1; b < scenes.size(); ++b)
      repeats.pairs.push_back(PairOf(a, b, Compare(scenes[a], scenes[b], options)));
  repeats.judged = JudgeRepeats(repeats.sweeps, repeats.pairs);
  return repeats;
}

nlohmann::ordered_json RepeatsJson(const MeasuredRepeats& repeats) {
  nlohmann::ordered_json json = {{"format", 1}, {"fit", repeats.judged.is_fit()}};
  json["reasons"] = EnglishTexts(repeats.judged.reasons);
  json["reason_messages"] = MessagesJson(repeats.judged.reasons);
  json["intervals"] = {{"held", repeats.judged.held}, {"of", repeats.judged.judged}};
  const auto key = [](std::size_t number) {
    return fmt::format("{}_{}", kNumberNames.at(number), UnitOf(number));
  };
  for (std::size_t i = 0; i < repeats.judged.scatter.size(); ++i)
    json["scatter"][key(i)] = repeats.judged.scatter[i]
                                  ? nlohmann::ordered_json(*repeats.judged.scatter[i])
                                  : nlohmann::ordered_json();
  json["sweeps"] = nlohmann::ordered_json::array();
  for (const RepeatedSweep& sweep : repeats.sweeps)
    json["sweeps"].push_back(
        {{"name", sweep.name},
         {"chi_square_per_term", sweep.chi2_per_term ? nlohmann::ordered_json(*sweep.chi2_per_term)
                                                     : nlohmann::ordered_json()}});
  json["pairs"] = nlohmann::ordered_json::array();
  for (const RepeatedPair& pair : repeats.pairs) {
    nlohmann::ordered_json& one = json["pairs"].emplace_back(nlohmann::ordered_json{
        {"reference", pair.reference}, {"current", pair.current}, {"verdict", Name(pair.verdict)}});
    for (std::size_t i = 0; i < pair.numbers.size(); ++i) {
      const auto& number = pair.numbers[i];
      one[key(i)] = number ? nlohmann::ordered_json(number->value) : nlohmann::ordered_json();
      one["uncertainty"][key(i)] =
          number ? nlohmann::ordered_json(number->u95) : nlohmann::ordered_json();
    }
  }
  return json;
}

}  // namespace plumb
