// SPDX-License-Identifier: Apache-2.0
#include "daemon/config/config.hpp"

#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "algo/base/units.hpp"
#include "daemon/config/sensor_settings.hpp"
#include "drivers/live/sensor_calibration.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/config/error_of.hpp"

namespace plumb {
namespace {

using ::testing::AllOf;
using testing::ErrorOf;
using ::testing::HasSubstr;
using namespace std::string_literals;

TEST(ConfigTest, AnEmptyFileKeepsEveryDefault) {
  const Config config = ParseConfig("", "test.toml");
  EXPECT_EQ(config.reconstruct.preset, Preset::kBest);
  EXPECT_DOUBLE_EQ(config.compare.limits.shift_tolerance_m,
                   CompareOptions{}.limits.shift_tolerance_m);
  EXPECT_FALSE(config.markers.dictionary);
  EXPECT_FALSE(config.region_file);
}

TEST(ConfigTest, TextsArePlain) {
  for (const char* line :
       {"[compare]\nregion = \"tor\u202Eso.json\"", "[web]\nhost_names = [\"plumb\u200B\"]"})
    EXPECT_THAT(ErrorOf(line), AllOf(HasSubstr("test.toml:2"), HasSubstr("expected")));
}

TEST(ConfigTest, ReadsEveryKeyInItsUnit) {
  const Config config = ParseConfig(R"(
[markers]
dictionary = "DICT_ARUCO_MIP_36h12"
length_m = 0.08
reference = 12
[reconstruct]
preset = "paper"
keep_color = false
use_markers = false
use_keypoints = false
keyframe_spacing = 1.3
num_icp_iterations = 50
seed = 9
[compare]
region = "torso.json"
isocentre_m = [0.4, 0.2, 0]
marker_kind = "couch"
posture = "FFP"
shift_tolerance_mm = 2
rotation_tolerance_deg = 0.5
min_shared_markers = 4
moved_marker_mm = 6.5
moved_marker_sigmas = 4
min_coverage = 0.8
max_hole_mm = 40
max_residual_p95_mm = 20
max_lost_s = 2
max_breathing_mm = 5
[iec]
T_iec_reference = [[0, -1, 0, 0.1], [1, 0, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]]
)",
                                    "test.toml");
  EXPECT_EQ(config.markers.dictionary, "DICT_ARUCO_MIP_36h12");
  EXPECT_EQ(config.markers.length_m, 0.08);
  EXPECT_EQ(config.markers.reference, 12);
  EXPECT_EQ(config.reconstruct.preset, Preset::kPaper);
  EXPECT_FALSE(config.reconstruct.keep_color);
  EXPECT_FALSE(config.reconstruct.use_markers);
  EXPECT_FALSE(config.reconstruct.use_keypoints);
  EXPECT_DOUBLE_EQ(config.reconstruct.keyframe_spacing, 1.3);
  EXPECT_EQ(config.reconstruct.num_icp_iterations, 50);
  EXPECT_EQ(config.reconstruct.seed, 9U);
  EXPECT_EQ(config.compare.preset, Preset::kPaper);
  EXPECT_EQ(config.region_file, "torso.json");
  EXPECT_EQ(config.compare.isocentre_m, Eigen::Vector3d(0.4, 0.2, 0));
  EXPECT_EQ(config.compare.marker_kind, MarkerKind::kCouch);
  EXPECT_EQ(config.compare.posture, PatientPosture::kFeetFirstProne);
  EXPECT_DOUBLE_EQ(config.compare.limits.shift_tolerance_m, 0.002);
  EXPECT_DOUBLE_EQ(config.compare.limits.rotation_tolerance_rad, 0.5 * kDegree);
  EXPECT_EQ(config.compare.limits.min_shared_markers, 4);
  EXPECT_DOUBLE_EQ(config.compare.markers.moved_m, 0.0065);
  EXPECT_DOUBLE_EQ(config.compare.markers.moved_sigmas, 4);
  EXPECT_DOUBLE_EQ(config.compare.limits.min_coverage, 0.8);
  EXPECT_DOUBLE_EQ(config.compare.limits.max_hole_m, 0.04);
  EXPECT_DOUBLE_EQ(config.compare.limits.max_residual_p95_m, 0.02);
  EXPECT_DOUBLE_EQ(config.compare.limits.max_lost_s, 2);
  EXPECT_DOUBLE_EQ(config.compare.limits.max_breathing_m, 0.005);
  EXPECT_NEAR(
      (*config.compare.T_iec_reference * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(0.1, 1.2, 0.3))
          .norm(),
      0, 1e-12);
}

TEST(ConfigTest, TheRoomsUncertaintyAndMarkersAreTaken) {
  const Config config =
      ParseConfig("[iec]\nu95_mm = 1.5\nu95_deg = 0.2\nmarkers = \"room\"\n", "test.toml");
  ASSERT_TRUE(config.compare.iec_u95_m && config.compare.iec_u95_rad && config.markers_scene);
  EXPECT_DOUBLE_EQ(*config.compare.iec_u95_m, 0.0015);
  EXPECT_DOUBLE_EQ(*config.compare.iec_u95_rad, 0.2 * kDegree);
  EXPECT_EQ(*config.markers_scene, "room");
  EXPECT_THAT(ErrorOf("[iec]\nu95_mm = -1\n"), HasSubstr("iec.u95_mm"));
  EXPECT_THAT(ErrorOf("[iec]\nu95_deg = 11\n"), HasSubstr("iec.u95_deg"));
}

TEST(ConfigTest, KeyframesAreHalfToTwiceAsFarApart) {
  for (const char* accepted : {"0.5", "2"})
    EXPECT_EQ(ErrorOf(fmt::format("[reconstruct]\nkeyframe_spacing = {}\n", accepted)), "no error");
  for (const char* refused : {"0.499", "2.001", "nan"})
    EXPECT_THAT(ErrorOf(fmt::format("[reconstruct]\nkeyframe_spacing = {}\n", refused)),
                AllOf(HasSubstr("reconstruct.keyframe_spacing"), HasSubstr("from 0.5 to 2")));
}

TEST(ConfigTest, NamesTheLineOfAnUnknownKey) {
  EXPECT_THAT(ErrorOf("[reconstruct]\nseed = 1\ncolour = true\n"),
              AllOf(HasSubstr("test.toml:3:"), HasSubstr("unknown key 'colour'")));
  EXPECT_THAT(ErrorOf("[recnstruct]\n"), AllOf(HasSubstr("test.toml:1:"), HasSubstr("recnstruct")));
}

TEST(ConfigTest, NamesLineKeyExpectedAndFound) {
  EXPECT_THAT(ErrorOf("\n[markers]\nlength_m = -0.1\n"),
              AllOf(HasSubstr("test.toml:3:"), HasSubstr("markers.length_m"), HasSubstr("-0.1")));
  EXPECT_THAT(ErrorOf("[markers]\ndictionary = \"DICT_6X6_25O\"\n"),
              AllOf(HasSubstr("test.toml:2: markers.dictionary"), HasSubstr("DICT_6X6_25O"),
                    HasSubstr("DICT_6X6_250, ")));
  EXPECT_THAT(ErrorOf("[reconstruct]\nseed = \"one\"\n"),
              AllOf(HasSubstr("test.toml:2:"), HasSubstr("seed"), HasSubstr("one")));
  EXPECT_THAT(ErrorOf("[reconstruct]\nseed = -1\n"), HasSubstr("reconstruct.seed"));
  EXPECT_THAT(ErrorOf("[reconstruct]\nnum_icp_iterations = 99999999999999\n"),
              HasSubstr("1 to 1000"));
  EXPECT_THAT(ErrorOf("[reconstruct]\npreset = \"fast\"\n"),
              AllOf(HasSubstr("\"best\", \"paper\""), HasSubstr("fast")));
  EXPECT_THAT(ErrorOf("[compare]\nshift_tolerance_mm = nan\n"), HasSubstr("shift_tolerance_mm"));
  EXPECT_THAT(ErrorOf("[compare]\nisocentre_m = [1, 2]\n"), HasSubstr("[x, y, z]"));
  EXPECT_THAT(ErrorOf("[iec]\nT_iec_reference = [[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]\n"),
              HasSubstr("rigid transform"));
  EXPECT_THAT(
      ErrorOf("[sensor]\nexposure_us = 40000\n"),
      AllOf(HasSubstr("sensor.exposure_us"), HasSubstr("33000"), HasSubstr("microseconds")));
  EXPECT_THAT(ErrorOf("[sensor]\nlibrary = \"librealsense2.so\"\n"),
              AllOf(HasSubstr("sensor.library"), HasSubstr("absolute path")));
  EXPECT_THAT(ErrorOf("compare = 3\n"), HasSubstr("a table"));
  EXPECT_THAT(ErrorOf("[compare\n"), AllOf(HasSubstr("test.toml:1:"), HasSubstr("not valid TOML")));
  EXPECT_THAT(ErrorOf("[web]\n[\0]\n"s), AllOf(HasSubstr("test.toml:2:"), HasSubstr("a byte 0")));
  EXPECT_THAT(ErrorOf("[%"), HasSubstr("not valid TOML"));
  EXPECT_THAT(ErrorOf(std::string(4096, '\0')), HasSubstr("test.toml:1:"));
  EXPECT_THAT(ErrorOf("# \x7f"), HasSubstr("a byte 127"));
}

// toml++ 3.3 has undefined behaviour for some of them.
TEST(ConfigTest, CharactersBeyondAsciiAreForStringsAndComments) {
  EXPECT_THAT(ErrorOf("\xc3\xa9 = 1"), HasSubstr("not valid TOML"));
  EXPECT_THAT(ErrorOf("~[\xef\xb3\xbfpa"), HasSubstr("not valid TOML"));
  EXPECT_THAT(ErrorOf("[web]\nlisten \xd0\x8d= 3"), HasSubstr("not valid TOML"));
  for (const char* accepted :
       {"[web]\r\n\t# ~ \xc3\xa9\r\n", "[appliance]\nstate = \"/\xc3\xa9\"\n",
        "[appliance]\nstate = '/\xc3\xa9'\n", "[appliance]\nstate = \"/\\\"\xc3\xa9\"\n"})
    EXPECT_EQ(ErrorOf(accepted), "no error") << accepted;
}

// What a patient's plan holds must not come from a file of the room.
TEST(ConfigTest, PlumbdRefusesTheKeysOfThePlanAndSaysWhereTheyBelong) {
  for (const char* line :
       {"region = \"torso.json\"", "isocentre_m = [0.1, 0.2, 0.3]", "marker_kind = \"couch\"",
        "posture = \"HFP\"", "shift_tolerance_mm = 3", "rotation_tolerance_deg = 1"}) {
    const std::string text = std::string("[compare]\nmax_hole_mm = 40\n") + line + "\n";
    const std::string key = std::string(line).substr(0, std::string(line).find(' '));
    try {
      (void)ParseConfig(text, "plumb.toml", ConfigUse::kAppliance);
      ADD_FAILURE() << line << " was taken";
    } catch (const DataError& error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr("plumb.toml:3: compare." + key),
                                      HasSubstr("plan of each reference"), HasSubstr("page")));
    }
    EXPECT_NO_THROW((void)ParseConfig(text, "plumb.toml", ConfigUse::kCommandLine)) << line;
  }
  EXPECT_DOUBLE_EQ(ParseConfig("[compare]\nmax_hole_mm = 40\n", "plumb.toml", ConfigUse::kAppliance)
                       .compare.limits.max_hole_m,
                   0.04)
      << "the limits of the room stay";
}

struct GateCase {
  const char* key;
  double method;   ///< The method's own limit, the loosest that plumbd takes.
  double loosest;  ///< The loosest that an experiment may set.
  double looser;   ///< A step in the loose direction.
};

class GateTest : public ::testing::TestWithParam<GateCase> {
 protected:
  static std::string Refusal(const std::string& section, const std::string& key, double value,
                             ConfigUse use) {
    const std::string text = fmt::format("[{}]\n{} = {}\n", section, key, value);
    try {
      (void)ParseConfig(text, "plumb.toml", use);
    } catch (const DataError& error) {
      return error.what();
    }
    return {};
  }
};

// A looser limit than the method's would let a result pass that nothing has shown to be right.
TEST_P(GateTest, PlumbdTakesNoLimitThatIsLooserThanTheMethods) {
  const auto [key, method, loosest, looser] = GetParam();
  EXPECT_EQ(Refusal("compare", key, method, ConfigUse::kAppliance), "");
  EXPECT_EQ(Refusal("compare", key, method - looser, ConfigUse::kAppliance), "") << "stricter";
  EXPECT_THAT(Refusal("compare", key, method + looser, ConfigUse::kAppliance),
              AllOf(HasSubstr(std::string("plumb.toml:2: compare.") + key + ": expected"),
                    HasSubstr("found"), HasSubstr("looser than the method's own"),
                    HasSubstr("remove the line")));
}

TEST_P(GateTest, AnExperimentMaySetALooserOneThatStillRefusesSomething) {
  const auto [key, method, loosest, looser] = GetParam();
  for (const ConfigUse use : {ConfigUse::kCommandLine, ConfigUse::kSimulatedAppliance}) {
    EXPECT_EQ(Refusal("compare", key, method + looser, use), "");
    EXPECT_EQ(Refusal("compare", key, loosest, use), "");
    EXPECT_THAT(Refusal("compare", key, loosest + looser, use),
                HasSubstr(std::string("compare.") + key + ": expected"));
  }
}

INSTANTIATE_TEST_SUITE_P(AllGates, GateTest,
                         ::testing::Values(GateCase{"min_shared_markers", 3, 1, -1},
                                           GateCase{"moved_marker_mm", 5, 100, 0.5},
                                           GateCase{"moved_marker_sigmas", 3, 100, 0.5},
                                           GateCase{"min_coverage", 0.9, 0.5, -0.01},
                                           GateCase{"max_hole_mm", 50, 300, 1},
                                           GateCase{"max_residual_p95_mm", 25, 100, 1},
                                           GateCase{"max_lost_s", 1, 10, 0.5},
                                           GateCase{"max_breathing_mm", 8, 50, 1}),
                         [](const auto& gate) { return std::string(gate.param.key); });

TEST_F(GateTest, TheDailyCheckOfARealSensorMayBeStricterOnly) {
  for (const auto& [key, method, looser] : {std::tuple("misfit_mm", 3.0, 0.1),
                                            {"moved_mm", 5.0, 0.1},
                                            {"side_percent", 3.0, 0.1},
                                            {"scale_percent", 0.5, 0.1},
                                            {"depth_percent", 3.0, 0.1},
                                            {"min_views", 3.0, -1.0},
                                            {"min_seen", 0.8, -0.1}}) {
    for (const ConfigUse use : {ConfigUse::kAppliance, ConfigUse::kSimulatedAppliance}) {
      EXPECT_EQ(Refusal("check", key, method, use), "");
      EXPECT_EQ(Refusal("check", key, method - looser, use), "");
    }
    EXPECT_THAT(Refusal("check", key, method + looser, ConfigUse::kAppliance),
                AllOf(HasSubstr(std::string("check.") + key), HasSubstr("looser")));
    EXPECT_EQ(Refusal("check", key, method + looser, ConfigUse::kSimulatedAppliance), "");
  }
}

TEST(ConfigTest, ASecondSensorIsAnotherOneThanTheFirstWhichHasToBeNamed) {
  const std::string first = "[appliance]\nsensor_serial = \"A\"\n";
  EXPECT_EQ(
      ParseConfig(first + "second_sensor_serial = \"B\"\n", "t").appliance.second_sensor_serial,
      "B");
  EXPECT_EQ(ErrorOf("[appliance]\nsecond_sensor_serial = \"\"\n"), "no error");
  for (const std::string& text : {first + "second_sensor_serial = \"A\"\n",
                                  std::string("[appliance]\nsecond_sensor_serial = \"B\"\n")})
    EXPECT_THAT(ErrorOf(text), HasSubstr("second_sensor_serial"));
}

TEST(ConfigTest, FixedSensorsAreTwoSerialsAtMost) {
  const std::string key = "[appliance]\nfixed_sensors = ";
  EXPECT_THAT(ParseConfig(key + "[\"A\", \"B\"]\n", "t").appliance.fixed_sensors,
              ::testing::ElementsAre("A", "B"));
  for (const char* bad : {"\"A\"", "[\"A\", \"B\", \"C\"]", "[1]", "[\"\"]"})
    EXPECT_THAT(ErrorOf(key + bad + "\n"), HasSubstr("fixed_sensors")) << bad;
}

TEST(ConfigTest, TheFirstSettingsMayBeGiven) {
  const ApplianceConfig none = ParseConfig("[appliance]\n", "t").appliance;
  EXPECT_FALSE(none.auto_stop_s || none.scan_limit_s || none.keep_recordings ||
               none.code_check_character);
  const ApplianceConfig given =
      ParseConfig(
          "[appliance]\nauto_stop_s = 2.5\nscan_limit_s = 30\nkeep_recordings = true\n"
          "code_check_character = true\n",
          "t")
          .appliance;
  EXPECT_EQ(given.auto_stop_s, 2.5);
  EXPECT_EQ(given.scan_limit_s, 30.0);
  EXPECT_EQ(given.keep_recordings, true);
  EXPECT_EQ(given.code_check_character, true);
  EXPECT_THAT(ErrorOf("[appliance]\ncode_check_character = 1\n"),
              HasSubstr("code_check_character"));
  EXPECT_THAT(ErrorOf("[appliance]\nauto_stop_s = 0\n"), HasSubstr("seconds from 0.1 to 3600"));
  EXPECT_THAT(ErrorOf("[appliance]\nresult_s = 60\n"), HasSubstr("unknown key 'result_s'"));
}

TEST(ConfigTest, APresetOfReconstructionsHoldsForComparisonsUnlessTheyHaveTheirOwn) {
  EXPECT_EQ(ParseConfig("[reconstruct]\npreset = \"paper\"\n", "t").compare.preset, Preset::kPaper);
  EXPECT_EQ(ParseConfig("[compare]\n", "t").compare.preset, Preset::kBest);
  const Config own = ParseConfig("[compare]\npreset = \"paper\"\n", "t");
  EXPECT_EQ(own.compare.preset, Preset::kPaper);
  EXPECT_EQ(own.reconstruct.preset, Preset::kBest);
}

TEST(ConfigTest, WhatTakesEffectAtTheStartIsKeptAndNamed) {
  const std::string at_start = R"(
[sensor]
driver = "realsense"
library = "/l"
exposure_us = 8000
[markers]
dictionary = "DICT_4X4_50"
length_m = 0.08
reference = 12
[button]
chip = "a"
line = "b"
active_low = false
[light]
chip = "c"
red = "d"
green = "e"
blue = "f"
beeper = "g"
active_low = true
[monitor]
gate_chip = "h"
gate_line = "i"
gate_active_low = true
[update]
folder = "/updates"
max_bundle_mb = 7
[web]
listen = "127.0.0.1:1"
tls_certificate = "/c"
tls_key = "/k"
plain_http = true
host_names = ["h"]
[appliance]
state = "/s"
control = "/c"
calibration = "/d"
sensor_serial = "7"
)";
  const Config in_use = ParseConfig("", "test.toml");
  Config next = ParseConfig(at_start + "quota_gb = 5\n[check]\nmin_views = 4\n", "test.toml");
  EXPECT_THAT(
      KeepUntilRestart(in_use, next),
      ::testing::UnorderedElementsAre(
          "markers.dictionary", "markers.length_m", "markers.reference", "button.chip",
          "button.line", "button.active_low", "light.chip", "light.red", "light.green",
          "light.blue", "light.beeper", "light.active_low", "monitor.gate_chip",
          "monitor.gate_line", "monitor.gate_active_low", "update.folder", "update.max_bundle_mb",
          "web.listen", "web.tls_certificate", "web.tls_key", "web.plain_http", "web.host_names",
          "appliance.state", "appliance.control", "appliance.calibration",
          "appliance.sensor_serial", "sensor.driver", "sensor.library", "sensor.exposure_us"));
  EXPECT_EQ(next.web.listen, in_use.web.listen);
  EXPECT_EQ(next.appliance.quota_gb, 5);
  EXPECT_EQ(next.check.min_views, 4);
  EXPECT_THAT(KeepUntilRestart(in_use, next), ::testing::IsEmpty());
}

// `plumb record`, `plumb doctor` and plumbd pass these settings to the driver as they are.
TEST(ConfigTest, ASensorsCalibrationFileMayNotNameOtherMarkersThanTheRooms) {
  const testing::TempFolder folder;
  const auto length_m = [&](const char* of_file) {
    std::ofstream(folder / "S1.yaml") << "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n"
                                         "camera_matrix: [525, 0, 319.5, 0, 525, 239.5, 0, 0, 1]\n"
                                         "distortion_coefficients: [0, 0, 0, 0, 0]\n"
                                      << "marker_length: " << of_file << '\n';
    SensorSettings settings =
        SensorSettingsOf(ParseConfig("[markers]\nlength_m = 0.083\n", "test.toml"));
    settings.calibration_folder = folder.path();
    return LiveStreamInfo(settings, "S1", 640, 480, 0.0).room_markers.length_m;
  };
  EXPECT_EQ(length_m("0.083"), 0.083);
  EXPECT_THROW((void)length_m("0.104"), DeviceError);
}

TEST(ConfigTest, WhatTheFileGivesIsKeptAsText) {
  const Config config = ParseConfig(
      "[web]\nlisten = \"[::1]:80\"\nhost_names = [\"a\", \"b\"]\n[appliance]\nquota_gb = 50.0\n"
      "sensor_profiles = true\n",
      "test.toml");
  EXPECT_THAT(config.given, ::testing::UnorderedElementsAre(
                                ::testing::Pair("web.listen", "'[::1]:80'"),
                                ::testing::Pair("web.host_names", "[ 'a', 'b' ]"),
                                ::testing::Pair("appliance.quota_gb", "50.0"),
                                ::testing::Pair("appliance.sensor_profiles", "true")));
}

TEST(ConfigTest, OffLoopbackThePageIsServedByTlsUnlessItIsSaidOtherwise) {
  const auto transport = [](const std::string& keys, bool is_loopback) {
    return TransportOf(ParseConfig("[web]\n" + keys, "t").web, is_loopback);
  };
  const std::string given = "tls_certificate = \"/c\"\ntls_key = \"/k\"\n";
  EXPECT_EQ(transport("", true), PageTransport::kPlain);
  EXPECT_EQ(transport("", false), PageTransport::kOwnTls);
  EXPECT_EQ(transport("plain_http = false\n", false), PageTransport::kOwnTls);
  EXPECT_EQ(transport("plain_http = true\n", false), PageTransport::kPlainOnNetwork);
  EXPECT_EQ(transport("plain_http = true\n", true), PageTransport::kPlain);
  EXPECT_EQ(transport(given, false), PageTransport::kGivenTls);
  EXPECT_EQ(transport(given, true), PageTransport::kGivenTls);
  for (const std::string& bad :
       {std::string("tls_key = \"/k\"\n"), std::string("tls_certificate = \"/c\"\n"),
        given + "plain_http = true\n"}) {
    EXPECT_THROW((void)transport(bad, false), DataError) << bad;
    EXPECT_THROW((void)transport(bad, true), DataError) << bad;
  }
}

TEST(ConfigTest, TheAppliancesPresetIsBestAlone) {
  EXPECT_NO_THROW(RefuseResearchPresets(Config{}));
  EXPECT_NO_THROW(RefuseResearchPresets(ParseConfig("[reconstruct]\npreset = \"best\"\n", "t")));
  for (const std::string section : {"compare", "reconstruct"}) {
    const Config config = ParseConfig("[" + section + "]\npreset = \"paper\"\n", "t");
    EXPECT_THAT([&] { RefuseResearchPresets(config); },
                ::testing::ThrowsMessage<DataError>(
                    HasSubstr("[" + section + "] preset: expected \"best\"")));
  }
}

TEST(ConfigTest, AMissingFileIsBadInput) {
  EXPECT_THROW((void)ReadConfig("/nonexistent/plumb.toml"), DataError);
}

class RegionTest : public ::testing::Test {
 protected:
  void SetUp() override {
    file_ = std::filesystem::path(::testing::TempDir()) /
            (std::string("region_") +
             ::testing::UnitTest::GetInstance()->current_test_info()->name() + ".json");
  }
  void TearDown() override { std::filesystem::remove(file_); }
  std::vector<Eigen::Vector2d> Read(const std::string& text) {
    std::ofstream(file_) << text;
    return ReadRegion(file_);
  }
  std::filesystem::path file_;
};

TEST_F(RegionTest, ReadsAPolygon) {
  const auto polygon = Read(
      R"({"format": 1, "frame": "reference_marker", "polygon_m": [[0, 0], [0.5, 0], [0.5, 0.25]]})");
  ASSERT_EQ(polygon.size(), 3U);
  EXPECT_EQ(polygon[2], Eigen::Vector2d(0.5, 0.25));
}

TEST_F(RegionTest, RefusesWhatIsNoRegion) {
  EXPECT_THROW((void)Read("{"), DataError);
  EXPECT_THROW((void)Read("[]"), DataError);
  EXPECT_THROW(
      (void)Read(
          R"({"format": 2, "frame": "reference_marker", "polygon_m": [[0, 0], [1, 0], [1, 1]]})"),
      DataError);
  EXPECT_THROW(
      (void)Read(R"({"format": 1, "frame": "world", "polygon_m": [[0, 0], [1, 0], [1, 1]]})"),
      DataError);
  EXPECT_THROW(
      (void)Read(R"({"format": 1, "frame": "reference_marker", "polygon_m": [[0, 0], [1, 0]]})"),
      DataError);
  EXPECT_THROW(
      (void)Read(
          R"({"format": 1, "frame": "reference_marker", "polygon_m": [[0, 0], [1, 0], [1, "a"]]})"),
      DataError);
  EXPECT_THROW(
      (void)Read(
          R"({"format": 1, "frame": "reference_marker", "polygon_m": [[0, 0], [1, 0], [1, 1e30]]})"),
      DataError);
  EXPECT_THROW((void)Read(R"({"format": 1, "frame": "reference_marker",
                                "polygon_m": [[0, 0], [1, 1], [1, 0], [0, 1]]})"),
               DataError)
      << "a bow tie";
  EXPECT_THROW((void)ReadRegion("/nonexistent.json"), DataError);
}

}  // namespace
}  // namespace plumb
