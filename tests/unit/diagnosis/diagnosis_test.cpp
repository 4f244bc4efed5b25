// SPDX-License-Identifier: Apache-2.0
#include "algo/diagnosis/diagnosis.hpp"

#include <algorithm>
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
  symptoms.focal_px = 525;
  symptoms.stream_offset = StreamOffset{0.003, 0.002};
  symptoms.num_frames = 100;
  symptoms.nearest_m = 0.3;
  symptoms.farthest_m = 4.0;
  symptoms.calibration = {.chi2 = 40,
                          .num_terms = 52,
                          .worst_term = "depth_offset_m",
                          .worst_value = 0.004,
                          .worst_sigma = 0.003,
                          .delay_s = 0.0};
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

TEST(DiagnosisTest, TheUnitThatTheMarkersShowIsNamed) {
  Symptoms symptoms = Sound();
  symptoms.depth_unit_assumed = true;
  symptoms.depth_units_per_metre = 5000;
  ScaleAll(symptoms, 0.2);
  EXPECT_THAT(Diagnose(symptoms).at(0).message.English(),
              ::testing::HasSubstr("depth_scale: 1000"));
}

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
      {"5000 that nothing states taken for 1000",
       [](Symptoms& s) {
         s.depth_unit_assumed = true;
         s.depth_units_per_metre = 1000;
         ScaleAll(s, 5.0);
       },
       {"depth_unit_unstated!"}},
      {"a depth camera that is not known, with depth beside the markers",
       [](Symptoms& s) {
         s.depth_camera_unknown = true;
         for (MarkerDepth& marker : s.marker_depths) marker.scatter = 0.3;
         s.calibration.chi2 = 9 * 52;
       },
       {"depth_camera_unknown!"}},
      {"a depth camera that is not known beside assumed cameras that do not fit",
       [](Symptoms& s) {
         s.depth_camera_unknown = s.cameras_assumed = true;
         s.calibration.chi2 = 9 * 52;
       },
       {"depth_camera_unknown!", "cameras_unstated!"}},
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
      {"camera_matrix of images of 1.5 times the size",
       [](Symptoms& s) { ScaleAll(s, 0.665); },
       {"unit_or_side!"}},
      {"millimetres for a tenth of a millimetre",
       [](Symptoms& s) { ScaleAll(s, 0.1); },
       {"depth_unit!"}},
      {"KITTI's 256 for 1000", [](Symptoms& s) { ScaleAll(s, 3.906); }, {"depth_unit!"}},
      {"disparity for depth, which no factor of units explains",
       [](Symptoms& s) { ScaleAll(s, 0.31); },
       {"unit_or_side!"}},
      {"depth of another clock drifts away, by 4 % of scatter",
       [](Symptoms& s) {
         for (MarkerDepth& marker : s.marker_depths) marker.scatter = 0.04;
       },
       {}},
      {"depth images in reverse order",
       [](Symptoms& s) {
         for (MarkerDepth& marker : s.marker_depths) marker.scatter = 0.09;
         s.calibration.chi2 = 19 * 52;
       },
       {"images_apart!"}},
      {"depth in reverse order over a flat floor, which most markers do not show",
       [](Symptoms& s) {
         for (const std::size_t i : {0U, 1U, 2U}) {
           s.marker_depths[i].ratio = 0.85;
           s.marker_depths[i].scatter = 0.04;
         }
         s.calibration.chi2 = 4.8 * 52;
       },
       {"images_apart!"}},
      {"two small markers, on which a hand lay",
       [](Symptoms& s) {
         for (const std::size_t i : {0U, 1U}) {
           s.marker_depths[i].ratio = 0.85;
           s.marker_depths[i].scatter = 0.04;
         }
       },
       {"markers_apart"}},
      {"depth mirrored",
       [](Symptoms& s) {
         s.depth_layout = DepthLayout::kMirrored;
         for (MarkerDepth& marker : s.marker_depths) marker.scatter = 0.09;
         s.marker_depths[2].ratio = 0.8;
         s.calibration.chi2 = 18 * 52;
       },
       {"depth_layout!"}},
      {"depth upside down, which a flat floor hardly shows",
       [](Symptoms& s) {
         s.depth_layout = DepthLayout::kUpsideDown;
         for (const std::size_t i : {0U, 1U}) s.marker_depths[i].ratio = 0.82;
       },
       {"depth_layout!"}},
      {"depth turned by half a turn",
       [](Symptoms& s) {
         s.depth_layout = DepthLayout::kTurned;
         for (MarkerDepth& marker : s.marker_depths) marker.scatter = 0.12;
       },
       {"depth_layout!"}},
      {"colour mirrored, so that depth does not fit either",
       [](Symptoms& s) {
         s.marker_depths.clear();
         s.foreign_markers = {ForeignMarkers::Kind::kMirrored, "DICT_6X6_250"};
         s.calibration.chi2 = 9.5 * 52;
       },
       {"mirrored!"}},
      {"another dictionary and a calibration that does not fit either",
       [](Symptoms& s) {
         s.marker_depths.clear();
         s.foreign_markers = {ForeignMarkers::Kind::kOtherDictionary, "DICT_4X4_50"};
         s.calibration.chi2 = 5 * 52;
       },
       {"other_dictionary!", "calibration!"}},
      {"depth smoothed over time",
       [](Symptoms& s) {
         s.calibration.chi2 = 4.3 * 52;
         s.calibration.delay_s = -0.052;
       },
       {"depth_lags!"}},
      {"depth of time of flight smoothed over time, which chi-square does not show",
       [](Symptoms& s) { s.calibration.delay_s = -0.023; },
       {"depth_lags!"}},
      {"depth 15 ms behind, which the solve takes up",
       [](Symptoms& s) { s.calibration.delay_s = -0.015; },
       {}},
      {"a lens stated with another distortion",
       [](Symptoms& s) {
         s.calibration = {.chi2 = 13.1 * 52,
                          .num_terms = 52,
                          .worst_term = "distortion_k1",
                          .worst_value = -0.24,
                          .worst_sigma = 0.01,
                          .delay_s = 0.0};
       },
       {"calibration!"}},
      {"a focal length 3 % off",
       [](Symptoms& s) {
         ScaleAll(s, 0.966);
         s.calibration = {.chi2 = 5.1 * 52,
                          .num_terms = 52,
                          .worst_term = "focal_y_scale",
                          .worst_value = -0.0224,
                          .worst_sigma = 0.002,
                          .delay_s = 0.0};
       },
       {"calibration!", "print_or_sensor"}},
      {"a sensor of another class, by the growth of its errors",
       [](Symptoms& s) {
         s.calibration = {.chi2 = 4.6 * 52,
                          .num_terms = 52,
                          .worst_term = "depth_field_growth_per_m_0_0",
                          .worst_value = 0.0134,
                          .worst_sigma = 0.002,
                          .delay_s = 0.0};
       },
       {"calibration!"}},
      {"nothing was calibrated",
       [](Symptoms& s) {
         s.calibration.chi2 = 900;
         s.calibration.num_terms = 0;
       },
       {}},
      {"dark images", [](Symptoms& s) { s.median_gray = 15; }, {"too_dark"}},
      {"dark images, whose markers look 4 % smaller",
       [](Symptoms& s) {
         s.median_gray = 15;
         ScaleAll(s, 0.96);
       },
       {"too_dark"}},
      {"a dim room", [](Symptoms& s) { s.median_gray = 40; }, {}},
      {"overexposed images", [](Symptoms& s) { s.share_white = 0.89; }, {"too_bright"}},
      {"white walls", [](Symptoms& s) { s.share_white = 0.4; }, {}},
      {"lamps that flicker", [](Symptoms& s) { s.share_flickers = 0.77; }, {"flickers"}},
      {"a door that opens", [](Symptoms& s) { s.share_flickers = 0.1; }, {}},
      {"swung in two seconds", [](Symptoms& s) { s.widths_per_s = 1.4; }, {"too_fast"}},
      {"a brisk sweep", [](Symptoms& s) { s.widths_per_s = 0.5; }, {}},
      {"two faults at once: prints at 97 %, and every sixth depth image repeated",
       [](Symptoms& s) {
         ScaleAll(s, 0.97);
         s.num_repeated_depth = 16;
       },
       {"repeated", "print_or_sensor"}},
      {"dark, and therefore without markers",
       [](Symptoms& s) {
         s.marker_depths.clear();
         s.median_gray = 6;
       },
       {"too_dark"}},
      {"both streams repeat",
       [](Symptoms& s) { s.num_repeated_depth = s.num_repeated_color = 14; },
       {"repeated", "repeated"}},
      {"wrong units, which the calibration cannot take up",
       [](Symptoms& s) {
         ScaleAll(s, 5.0);
         s.calibration.chi2 = 5000;
       },
       {"depth_unit!"}},
  };
  EXPECT_GE(std::ranges::count_if(rows, [](const Row& row) { return !row.causes.empty(); }), 60);
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
  EXPECT_THAT(Diagnose(symptoms)[1].message.English(),
              testing::HasSubstr("the focal length of the colour camera is 510 px"));
  symptoms = Sound();
  symptoms.depth_layout = DepthLayout::kTurned;
  EXPECT_THAT(Diagnose(symptoms)[0].message.English(),
              testing::HasSubstr("the depth images are turned by half a turn against"));
  symptoms = Sound();
  symptoms.calibration = {.chi2 = 533,
                          .num_terms = 52,
                          .worst_term = "depth_offset_m",
                          .worst_value = 0.0295,
                          .worst_sigma = 0.003,
                          .delay_s = 0.0};
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
