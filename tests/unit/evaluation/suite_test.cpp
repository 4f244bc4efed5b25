// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "daemon/evaluation/evaluation.hpp"
#include "daemon/evaluation/report.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::Pair;

class SuiteTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        fs::path(testing::TempDir()) /
        (std::string("suite_") + testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  void MakeScene(const std::string& name, const std::string& recordings) {
    fs::create_directories(folder_ / "truth" / name);
    fs::create_directories(folder_ / recordings / name);
  }
  void WriteSuite(const std::string& text) { std::ofstream(folder_ / "suite.json") << text; }
  fs::path folder_;
};

TEST_F(SuiteTest, FollowsTheSuiteFile) {
  for (const char* name : {"a", "b", "c"}) MakeScene(name, "recordings");
  WriteSuite(R"({"name": "x", "scenes": ["a", "b", "c"], "pairs": [["a", "c"]]})");
  const Suite suite = OpenSuite(folder_);
  EXPECT_EQ(suite.name, "x");
  EXPECT_THAT(suite.scenes, ElementsAre("a", "b", "c"));
  EXPECT_THAT(suite.pairs, ElementsAre(Pair("a", "c")));
  EXPECT_EQ(suite.recordings.at("b"), folder_ / "recordings" / "b");
  EXPECT_EQ(suite.truths.at("b"), folder_ / "truth" / "b");
}

TEST_F(SuiteTest, WithoutASuiteFileEveryOrderedPairCounts) {
  for (const char* name : {"current", "reference"}) MakeScene(name, ".");
  const Suite suite = OpenSuite(folder_);
  EXPECT_THAT(suite.scenes, ElementsAre("reference", "current"));
  EXPECT_THAT(suite.pairs, ElementsAre(Pair("reference", "current"), Pair("current", "reference")));
  EXPECT_TRUE(fs::equivalent(suite.recordings.at("current"), folder_ / "current"));
}

TEST_F(SuiteTest, RefusesWhatIsNoSuite) {
  EXPECT_THROW((void)OpenSuite(folder_), DataError);
  MakeScene("a", "recordings");
  for (const char* text :
       {"{", "[]", "{}", R"({"scenes": ["../a"], "pairs": []})",
        R"({"scenes": ["a"], "pairs": [["a", "b"]]})", R"({"scenes": ["a", "b"], "pairs": []})",
        R"({"scenes": [], "pairs": []})", R"({"scenes": ["a"], "pairs": [["a"]]})"}) {
    WriteSuite(text);
    EXPECT_THROW((void)OpenSuite(folder_), DataError) << text;
  }
}

TEST(EvaluationStatisticsTest, APairWithoutAMotionIsCountedButIsNoZero) {
  Evaluation evaluation;
  evaluation.pairs.resize(3);
  evaluation.pairs[0].reference = evaluation.pairs[1].reference = "a";
  evaluation.pairs[2].reference = "b";
  evaluation.pairs[0].motion = MotionError{.rotation_deg = 1, .translation_mm = 4};
  evaluation.pairs[0].verdict = Verdict::kMove;
  evaluation.pairs[2].motion = MotionError{.rotation_deg = 3, .translation_mm = 8};
  evaluation.pairs[2].verdict = Verdict::kMove;
  EXPECT_EQ(evaluation.Total().num_pairs, 3U);
  EXPECT_EQ(evaluation.Total().num_without_motion, 1U);
  EXPECT_EQ(evaluation.Total().num_no_answer, 1U);
  EXPECT_DOUBLE_EQ(evaluation.Total().translation_mm.mean, 6);
  EXPECT_DOUBLE_EQ(evaluation.OfReference("a").translation_mm.mean, 4);
}

TEST(EvaluationReportTest, WhatWasNotMeasuredIsNoZero) {
  Evaluation evaluation;
  evaluation.scenes.resize(1);
  evaluation.scenes[0].name = "blind";
  const std::string table = EvaluationTable(evaluation);
  const std::string row = table.substr(table.find("  blind"), 100);
  EXPECT_THAT(row, testing::Not(testing::HasSubstr("0.0"))) << row;
  EXPECT_THAT(row, testing::HasSubstr("none"));
  const auto scene = nlohmann::json::parse(EvaluationJson(evaluation)).at("scenes").at("blind");
  for (const char* key :
       {"trajectory_keyframes", "trajectory_all", "marker_rms_mm", "marker_scale_permille"})
    EXPECT_TRUE(scene.at(key).is_null()) << key;

  evaluation.scenes[0].trajectory = TrajectoryError{.rmse_mm = 1.25};
  evaluation.scenes[0].marker_rms_mm = 0.75;
  evaluation.scenes[0].marker_scale_permille = 2.0;
  EXPECT_THAT(EvaluationTable(evaluation), testing::AllOf(testing::HasSubstr("none   1.25"),
                                                          testing::HasSubstr("|   0.75  +2.0 |")));
  evaluation.scenes[0].true_breathing_mm = 5.0;
  EXPECT_THAT(EvaluationTable(evaluation),
              testing::HasSubstr("blind      rise  5.00 mm, estimated not at all"));
  evaluation.scenes[0].breathing_mm = 4.25;
  EXPECT_THAT(EvaluationTable(evaluation),
              testing::HasSubstr("estimated  4.25 mm, error -0.75 mm"));
}

}  // namespace
}  // namespace plumb
