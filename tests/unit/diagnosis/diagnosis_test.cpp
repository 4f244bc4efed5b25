// SPDX-License-Identifier: Apache-2.0
#include "algo/diagnosis/diagnosis.hpp"

#include <functional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "words/diagnosis.hpp"

namespace plumb {
namespace {

// A sweep with which nothing is wrong.
Symptoms Sound() {
  Symptoms symptoms;
  for (int id = 0; id < 7; ++id)
    symptoms.marker_depths.push_back(
        {.id = id, .ratio = 1.0 + 0.002 * (id - 3), .scatter = 0.006, .num_views = 12});
  symptoms.marker_length_m = 0.104;
  symptoms.stream_offset = StreamOffset{0.003, 0.002};
  symptoms.num_frames = 100;
  symptoms.nearest_m = 0.3;
  symptoms.farthest_m = 4.0;
  symptoms.calibration = {.chi2 = 40,
                          .num_terms = 52,
                          .worst_term = "depth_offset_m",
                          .worst_value = 0.004,
                          .worst_sigma = 0.003};
  return symptoms;
}

void ScaleAll(Symptoms& s, double factor) {
  for (MarkerDepth& marker : s.marker_depths) {
    marker.ratio *= factor;
    marker.scatter *= factor;
  }
}

// "id" for a warning, "id!" for a refusal, in their order.
std::vector<std::string> Causes(const Symptoms& symptoms) {
  std::vector<std::string> causes;
  for (const Finding& finding : Diagnose(symptoms))
    causes.push_back(finding.message.id().substr(finding.message.id().find('.') + 1) +
                     (finding.level == FindingLevel::kRefusal ? "!" : ""));
  return causes;
}

struct Row {
  const char* what;
  std::function<void(Symptoms&)> fault;
  std::vector<std::string> causes;
};

TEST(DiagnosisTest, NamesTheCauseOfEachFaultAndNothingElse) {
  const std::vector<Row> rows = {
      {"sound", [](Symptoms&) {}, {}},
      {"no markers, no depth on them", [](Symptoms& s) { s.marker_depths.clear(); }, {}},
      {"a unit that nothing states, and markers confirm",
       [](Symptoms& s) { s.depth_unit_assumed = true; },
       {}},
      {"a unit that nothing states or confirms",
       [](Symptoms& s) {
         s.depth_unit_assumed = true;
         s.marker_depths.clear();
       },
       {"depth_unit_unknown!"}},
      {"too short for an offset", [](Symptoms& s) { s.stream_offset.reset(); }, {}},
      {"sensor 1.9 % off", [](Symptoms& s) { ScaleAll(s, 1.019); }, {}},
      {"prints at 97 %", [](Symptoms& s) { ScaleAll(s, 0.97); }, {"print_or_sensor"}},
      {"prints at 103 %", [](Symptoms& s) { ScaleAll(s, 1.03); }, {"print_or_sensor"}},
      {"prints at 94 %, fitted to Letter",
       [](Symptoms& s) { ScaleAll(s, 0.94); },
       {"print_or_sensor"}},
      {"half the side stated", [](Symptoms& s) { ScaleAll(s, 2.0); }, {"unit_or_side!"}},
      {"sheet measured for square", [](Symptoms& s) { ScaleAll(s, 0.75); }, {"unit_or_side!"}},
      {"1000 for 5000", [](Symptoms& s) { ScaleAll(s, 5.0); }, {"depth_unit!"}},
      {"5000 for 1000", [](Symptoms& s) { ScaleAll(s, 0.2); }, {"depth_unit!"}},
      {"1000 for 4000", [](Symptoms& s) { ScaleAll(s, 4.0); }, {"depth_unit!"}},
      {"100 for 1000", [](Symptoms& s) { ScaleAll(s, 10.0); }, {"depth_unit!"}},
      {"inches for centimetres in the side",
       [](Symptoms& s) { ScaleAll(s, 2.54); },
       {"unit_or_side!"}},
      {"one marker at 80 %",
       [](Symptoms& s) { s.marker_depths[2].ratio = 0.8; },
       {"markers_apart"}},
      {"half of the markers at 70 %",
       [](Symptoms& s) {
         for (const std::size_t i : {0U, 1U, 2U}) s.marker_depths[i].ratio = 0.7;
       },
       {"markers_apart!"}},
      {"one marker at 80 %, seen in two views",
       [](Symptoms& s) {
         s.marker_depths[2].ratio = 0.8;
         s.marker_depths[2].num_views = 2;
       },
       {}},
      {"one marker at 80 % and all prints at 97 %",
       [](Symptoms& s) {
         s.marker_depths[2].ratio = 0.8;
         ScaleAll(s, 0.97);
       },
       {"markers_apart", "print_or_sensor"}},
      {"depth of another sweep",
       [](Symptoms& s) {
         for (MarkerDepth& marker : s.marker_depths) marker.scatter = 0.3;
       },
       {"images_apart!"}},
      {"depth 200 ms late",
       [](Symptoms& s) {
         s.stream_offset = StreamOffset{0.2, 0.004};
       },
       {"depth_late!"}},
      {"depth 33 ms early",
       [](Symptoms& s) {
         s.stream_offset = StreamOffset{-0.033, 0.004};
       },
       {"depth_early!"}},
      {"depth 15 ms late, harmless",
       [](Symptoms& s) {
         s.stream_offset = StreamOffset{0.015, 0.001};
       },
       {}},
      {"an offset that is not determined",
       [](Symptoms& s) {
         s.stream_offset = StreamOffset{0.05, 0.02};
       },
       {}},
      {"depth late, so that it disagrees with the markers and the calibration",
       [](Symptoms& s) {
         s.stream_offset = StreamOffset{0.2, 0.004};
         for (MarkerDepth& marker : s.marker_depths) marker.scatter = 0.2;
         s.calibration.chi2 = 900;
       },
       {"depth_late!"}},
      {"every second depth image repeated",
       [](Symptoms& s) { s.num_repeated_depth = 50; },
       {"repeated"}},
      {"one image in twenty repeated", [](Symptoms& s) { s.num_repeated_depth = 5; }, {}},
      {"colour images repeated", [](Symptoms& s) { s.num_repeated_color = 6; }, {"repeated"}},
      {"held too near", [](Symptoms& s) { s.share_near = 0.83; }, {"too_near!"}},
      {"somewhat too near", [](Symptoms& s) { s.share_near = 0.21; }, {"too_near"}},
      {"a little too near", [](Symptoms& s) { s.share_near = 0.2; }, {}},
      {"a room beyond", [](Symptoms& s) { s.share_far = 0.3; }, {"too_far"}},
      {"mirrored",
       [](Symptoms& s) {
         s.marker_depths.clear();
         s.foreign_markers = {ForeignMarkers::Kind::kMirrored, "DICT_6X6_250"};
       },
       {"mirrored!"}},
      {"inverted",
       [](Symptoms& s) {
         s.marker_depths.clear();
         s.foreign_markers = {ForeignMarkers::Kind::kInverted, "DICT_6X6_250"};
       },
       {"inverted!"}},
      {"another dictionary",
       [](Symptoms& s) {
         s.marker_depths.clear();
         s.foreign_markers = {ForeignMarkers::Kind::kOtherDictionary, "DICT_4X4_50"};
       },
       {"other_dictionary!"}},
      {"chi-square 2 for each term", [](Symptoms& s) { s.calibration.chi2 = 104; }, {}},
      {"chi-square above 2", [](Symptoms& s) { s.calibration.chi2 = 105; }, {"calibration"}},
      {"chi-square 4", [](Symptoms& s) { s.calibration.chi2 = 208; }, {"calibration"}},
      {"chi-square above 4", [](Symptoms& s) { s.calibration.chi2 = 209; }, {"calibration!"}},
      {"chi-square 5.5 with assumed cameras",
       [](Symptoms& s) {
         s.calibration.chi2 = 5.5 * 52;
         s.cameras_assumed = true;
       },
       {}},
      {"chi-square above 5.5 with assumed cameras",
       [](Symptoms& s) {
         s.calibration.chi2 = 5.6 * 52;
         s.cameras_assumed = true;
       },
       {"cameras_unstated!"}},
      {"assumed cameras that fit", [](Symptoms& s) { s.cameras_assumed = true; }, {}},
      {"assumed cameras that fit, which no marker confirms",
       [](Symptoms& s) {
         s.cameras_assumed = true;
         s.marker_depths.clear();
       },
       {"cameras_unconfirmed!"}},
      {"assumed cameras and units, which no marker confirms",
       [](Symptoms& s) {
         s.cameras_assumed = s.depth_unit_assumed = true;
         s.marker_depths.clear();
       },
       {"cameras_unconfirmed!", "depth_unit_unknown!"}},
      {"assumed cameras that do not fit, without markers",
       [](Symptoms& s) {
         s.cameras_assumed = true;
         s.marker_depths.clear();
         s.calibration.chi2 = 9 * 52;
       },
       {"cameras_unstated!"}},
      {"an assumed focal length 2.5 % off",
       [](Symptoms& s) {
         s.cameras_assumed = true;
         ScaleAll(s, 1.025);
       },
       {"cameras_or_size"}},
      {"an assumed focal length 15 % off",
       [](Symptoms& s) {
         s.cameras_assumed = true;
         ScaleAll(s, 1.15);
       },
       {"cameras_or_size!"}},
      {"1000 for 5000 with assumed cameras",
       [](Symptoms& s) {
         s.cameras_assumed = true;
         ScaleAll(s, 5.0);
       },
       {"depth_unit!"}},
      {"wrong units, which the calibration cannot take up",
       [](Symptoms& s) {
         ScaleAll(s, 5.0);
         s.calibration.chi2 = 5000;
       },
       {"depth_unit!"}},
  };
  for (const Row& row : rows) {
    Symptoms symptoms = Sound();
    row.fault(symptoms);
    EXPECT_THAT(Causes(symptoms), testing::ElementsAreArray(row.causes)) << row.what;
  }
}

TEST(DiagnosisTest, SaysWhatAndHowMuch) {
  Symptoms symptoms = Sound();
  ScaleAll(symptoms, 0.97);
  symptoms.marker_depths[2].ratio = 0.8;
  EXPECT_EQ(Diagnose(symptoms)[0].message, say::diagnosis::MarkersApart(1, {2}));
  EXPECT_THAT(Diagnose(symptoms)[1].message.English(), testing::HasSubstr("a side is 101.1 mm"));
  symptoms = Sound();
  symptoms.calibration = {.chi2 = 533,
                          .num_terms = 52,
                          .worst_term = "depth_offset_m",
                          .worst_value = 0.0295,
                          .worst_sigma = 0.003};
  EXPECT_THAT(Diagnose(symptoms)[0].message.English(),
              testing::HasSubstr("depth_offset_m is 0.0295, expected within 0.0030"));
}

TEST(DiagnosisTest, LengthsAreDoubtedAsMuchAsDepthAndMarkersDisagree) {
  Symptoms symptoms = Sound();
  EXPECT_EQ(ScaleDoubt(symptoms), 0.0);
  ScaleAll(symptoms, 0.97);
  EXPECT_NEAR(ScaleDoubt(symptoms), 0.03 + 0.01, 0.003);
  symptoms.marker_depths.clear();
  EXPECT_EQ(ScaleDoubt(symptoms), 0.0);
}

}  // namespace
}  // namespace plumb
