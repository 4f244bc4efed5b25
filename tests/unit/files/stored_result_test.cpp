// SPDX-License-Identifier: Apache-2.0
#include "daemon/result/stored_result.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "daemon/result/result_folder.hpp"
#include "tests/support/message_of.hpp"
#include "tests/unit/files/small_output.hpp"

namespace plumb {
namespace {

using Json = nlohmann::ordered_json;
using ::testing::AllOf;
using testing::Answer;
using ::testing::HasSubstr;
using testing::MessageOf;

Json Written() { return Json::parse(ResultText(Stored(Answer()))); }
StoredResult Parsed(const Json& json) { return ParseResult(json.dump(), "result.json"); }
std::string Refused(const Json& json) {
  return MessageOf<DataError>([&] { (void)Parsed(json); });
}

TEST(StoredResultTest, IsReadAsItWasWritten) {
  Comparison comparison = Answer();
  comparison.body_parts.emplace().by_posture = true;
  comparison.body_parts->patient = PatientAxes{};
  comparison.body_parts->room = RoomWays{};
  comparison.body_parts->parts.emplace_back().name = Message::Verbatim("left shoulder");
  comparison.region->coverage = std::nan("");
  const std::string text =
      ResultText(Stored(comparison, ResultRoom{3, Message::Verbatim("a marker moved")}));
  EXPECT_EQ(ResultText(ParseResult(text, "result.json")), text);
  EXPECT_EQ(ResultText(ParseResult(ResultText(Stored({})), "result.json")), ResultText(Stored({})));
}

TEST(StoredResultTest, TheJudgementOfEachNumberIsStored) {
  EXPECT_EQ(Written()["correction"]["judgements"], (Json{{"vertical", "outside"},
                                                         {"longitudinal", "in_tolerance"},
                                                         {"lateral", "unsure"},
                                                         {"pitch", "in_tolerance"},
                                                         {"roll", "in_tolerance"},
                                                         {"yaw", "in_tolerance"}}));
}

// 0.2.0 wrote no judgements and no messages.
TEST(StoredResultTest, ARecordOfAnOlderVersionIsJudgedWhenItIsRead) {
  Json json = Written();
  json["correction"].erase("judgements");
  json["correction"].erase("word_messages");
  json.erase("reason_messages");
  json.erase("warning_messages");
  const StoredResult read = Parsed(json);
  EXPECT_EQ(read.correction->judgements, Answer().judgements);
  EXPECT_EQ(read.correction->words[0], Message::Verbatim("down 9.0 mm"));
  EXPECT_EQ(EnglishTexts(read.reasons), EnglishTexts(Answer().reasons));
  json["correction"].erase("uncertainty");
  EXPECT_EQ(Parsed(json).correction->judgements[1], NumberJudgement::kUnjudged)
      << "an uncertainty that is absent is not known, never 0";
}

TEST(StoredResultTest, WhatIsMissingOrOfAnotherKindIsNamed) {
  const auto without = [](const char* part, const char* key) {
    Json json = Written();
    (part == nullptr ? json : json[part]).erase(key);
    return Refused(json);
  };
  for (const char* key : {"version", "preset", "verdict", "reasons", "limits", "warnings"})
    EXPECT_THAT(without(nullptr, key),
                HasSubstr("result.json: " + std::string(key) + " is missing"));
  EXPECT_THAT(without("region", "coverage"), HasSubstr("region.coverage is missing"));
  EXPECT_THAT(without("limits", "max_lost_s"), HasSubstr("limits.max_lost_s is missing"));
  EXPECT_THAT(without("correction", "yaw_deg"), HasSubstr("correction.yaw_deg is not known"));
  const auto with = [](const char* pointer, const Json& value) {
    Json json = Written();
    json[Json::json_pointer(pointer)] = value;
    return Refused(json);
  };
  EXPECT_THAT(with("/region/coverage", "0.9"),
              HasSubstr("region.coverage is \"0.9\", expected a number"));
  EXPECT_THAT(with("/alignment/markers_used/1", 2.5),
              HasSubstr("alignment.markers_used[1] is 2.5, expected a whole number"));
  EXPECT_THAT(with("/motion/T/3", {1.0}), HasSubstr("motion.T[3] is [1.0], expected a list of 4"));
  EXPECT_THAT(with("/verdict", "fine"),
              AllOf(HasSubstr("verdict is \"fine\", expected one of in_tolerance"),
                    HasSubstr("no_answer")));
  EXPECT_THAT(with("/correction", 7), HasSubstr("correction is 7, expected an object"));
  EXPECT_THAT(with("/format", 2), HasSubstr("format 2"));
}

TEST(StoredResultTest, AJudgementThatContradictsTheNumbersIsRefused) {
  Json json = Written();
  json["correction"]["judgements"]["vertical"] = "in_tolerance";
  EXPECT_THAT(Refused(json), HasSubstr("judgements.vertical is in_tolerance, but the numbers"));
  json = Written();
  json["verdict"] = "in_tolerance";
  EXPECT_THAT(Refused(json), HasSubstr("verdict is in_tolerance, but the numbers"));
  json = Written();
  json["correction"]["vertical_mm"] = -2.0;
  EXPECT_THAT(Refused(json), HasSubstr("vertical is outside, but the numbers"));
  json = Written();
  json["correction"] = nullptr;
  EXPECT_THAT(Refused(json), HasSubstr("verdict is move, but there are no numbers"));
  json["verdict"] = "no_answer";
  EXPECT_FALSE(Parsed(json).correction);
}

}  // namespace
}  // namespace plumb
