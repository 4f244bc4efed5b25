// SPDX-License-Identifier: Apache-2.0
#include "daemon/result/stored_result.hpp"

#include <cmath>

#include <fmt/format.h>

#include "algo/base/bounded_json.hpp"
#include "daemon/files/stored_fields.hpp"
#include "words/scene_file.hpp"
#include "words/stored_file.hpp"

namespace plumb {
namespace {

using stored::FieldWriter, stored::Found, stored::Json, stored::NumberKey, stored::Read;

[[noreturn]] void Contradict(const std::string& where, std::string_view found,
                             std::string_view expected) {
  throw DataError(
      say::stored_file::Contradiction(where, std::string(found), std::string(expected)));
}

/// Rotations are always known, whether or not markers are fixed to the couch.
void RequireRotations(const StoredCorrection& correction, const std::string& where) {
  for (std::size_t i = 0; i < correction.value.size(); ++i) {
    if (!IsShift(i) && !(correction.value[i] && std::isfinite(*correction.value[i])))
      throw DataError(say::stored_file::NoRotation(fmt::format("{}{}", where, NumberKey(i))));
  }
}

/// What was decided must follow from what is stored beside it.
void CheckJudgements(StoredResult& result, bool has_judgements, const std::string& where) {
  if (!result.correction) {
    if (result.verdict == Verdict::kNoAnswer) return;
    throw DataError(
        say::stored_file::NoNumbers(where + "verdict", std::string(Name(result.verdict))));
  }
  StoredCorrection& correction = *result.correction;
  RequireRotations(correction, where + "correction.");
  std::array<bool, 6> is_reported{};
  for (std::size_t i = 0; i < is_reported.size(); ++i) {
    const NumberJudgement expected =
        JudgeNumber(correction.value[i], correction.u95[i], result.limits.ToleranceOf(i));
    if (!has_judgements) correction.judgements[i] = expected;
    if (correction.judgements[i] != expected)
      Contradict(fmt::format("{}correction.judgements.{}", where, kNumberNames[i]),
                 Name(correction.judgements[i]), Name(expected));
    is_reported[i] = correction.value[i].has_value();
  }
  if (result.verdict == Verdict::kNoAnswer) return;
  const Verdict expected = VerdictOf(correction.judgements, is_reported);
  if (result.verdict != expected)
    Contradict(where + "verdict", Name(result.verdict), Name(expected));
}

void TakeDirection(std::optional<Eigen::Vector2d>& way, const std::string& where) {
  if (!way) return;
  if (!way->allFinite() || way->norm() < 1e-6)
    throw DataError(say::stored_file::NoDirection(where));
  way->normalize();
}

}  // namespace

std::string ResultText(const StoredResult& result) {
  Json json = {{"format", StoredResult::kFormat}};
  StoredResult::Fields(result, FieldWriter(json));
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

StoredResult ParseResult(std::string_view text, const std::string& name) {
  const Json json = ParseBoundedJsonOrNothing<Json>(text);
  if (!json.is_object() || !json.contains("format") || !json["format"].is_number_integer())
    throw DataError(say::scene_file::NoResult(name));
  const auto format = json["format"].get<std::int64_t>();
  if (format != StoredResult::kFormat)
    throw DataError(say::scene_file::OtherResultFormat(name, format, StoredResult::kFormat));
  StoredResult result;
  const std::string where = name + ": ";
  const Message remedy = say::stored_file::CompareAgain();
  Read(Found{json, where, remedy}, result);
  const Json correction = json.value("correction", Json());
  CheckJudgements(result, correction.is_object() && correction.contains("judgements"), where);
  if (auto& body = result.body) {
    TakeDirection(body->head_xy, where + "body.head_xy");
    TakeDirection(body->left_xy, where + "body.left_xy");
    TakeDirection(body->gantry_xy, where + "body.gantry_xy");
    TakeDirection(body->right_xy, where + "body.right_xy");
  }
  return result;
}

Json CorrectionJson(const StoredCorrection& correction) { return stored::Written(correction); }

StoredCorrection ParseCorrection(const Json& json) {
  StoredCorrection correction;
  const Message remedy = say::stored_file::CompareAgain();
  Read(Found{json, "correction", remedy}, correction);
  RequireRotations(correction, "correction.");
  return correction;
}

}  // namespace plumb
