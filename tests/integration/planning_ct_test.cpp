// SPDX-License-Identifier: Apache-2.0
// Planning CTs on the command line.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <vector>

#include "algo/planning/ct_skin.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/mesh_formats/mesh_file.hpp"
#include "drivers/dicom/planning_files.hpp"
#include "tests/integration/command_line.hpp"
#include "tests/unit/dicom/small_files.hpp"

namespace plumb {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

class PlanningCtTest : public CommandLineTest {
 protected:
  RunResult Import(const simulated::PlanningCtOptions& options,
                   const std::vector<std::string>& more = {}) {
    const auto [structures, plan] = SmallCt(options);
    std::vector<std::string> arguments = {
        "import-dicom", Written(folder_ / "structures.dcm", DicomBytes(structures)),
        Written(folder_ / "plan.dcm", DicomBytes(plan)), "--out", folder_ / "planned"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Plumb(arguments);
  }

  /// What `plumb evaluate` finds for the suite in the folder.
  json Evaluated() {
    const RunResult result = Plumb({"evaluate", folder_, "--config", folder_ / "room.toml", "--out",
                                    folder_ / "out", "--json"});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    json total = json::parse(result.out).at("total");
    EXPECT_EQ(total.at("without_motion"), 0);
    return total;
  }
};

TEST_F(PlanningCtTest, ASceneIsWrittenOrNothing) {
  using simulated::CtQuirk;
  const RunResult several = Import({.quirks = {CtQuirk::kSeveralExternal}});
  EXPECT_EQ(several.exit_code, 3);
  EXPECT_THAT(several.err, HasSubstr("--roi"));
  EXPECT_TRUE(LeftBehind({"structures.dcm", "plan.dcm"}).empty());
  const RunResult chosen =
      Import({.quirks = {CtQuirk::kSeveralExternal}}, {"--roi", "BODY", "--json"});
  ASSERT_EQ(chosen.exit_code, 0) << chosen.err;
  const json scene = json::parse(chosen.out);
  EXPECT_EQ(scene.at("source"), "dicom");
  EXPECT_EQ(scene.at("frame"), "iec");
  EXPECT_TRUE(scene.at("markers").empty());
  for (const char* name : {"heightmap.tiff", "cloud.ply", "mesh.ply"})
    EXPECT_TRUE(fs::exists(folder_ / "planned" / name)) << name;
  EXPECT_EQ(ReadScene(folder_ / "planned").planning->roi, "BODY");
}

TEST_F(PlanningCtTest, ImagesTakeThePlaceOfAContourThatIsMissing) {
  const simulated::PlanningCtOptions options{.quirks = {simulated::CtQuirk::kNoExternal}};
  EXPECT_EQ(Import(options).exit_code, 3);
  fs::create_directory(folder_ / "ct");
  int number = 0;
  simulated::MakeCtImages(SmallCt(options).first, options, {.pixel_mm = 1.0},
                          [&](const CtImage& image) {
                            Written(folder_ / "ct" / std::to_string(++number), DicomBytes(image));
                          });
  const RunResult both = Import(options, {"--images", folder_ / "ct", "--json"});
  ASSERT_EQ(both.exit_code, 0) << both.err;
  EXPECT_EQ(json::parse(both.out).at("planning").at("roi"), "CT -300 HU");
  const RunResult images = Plumb({"import-dicom", "--images", folder_ / "ct", folder_ / "plan.dcm",
                                  "--threshold", "-500", "--out", folder_ / "planned"});
  ASSERT_EQ(images.exit_code, 0) << images.err;
  EXPECT_THAT(images.out, HasSubstr("CT -500 HU"));
  EXPECT_THAT(images.out, HasSubstr("the couch, whose top lies -100.0 mm above"));
  const double top_m = ReadScene(folder_ / "planned").cloud.points.front().z();
  EXPECT_NEAR(top_m, 0.1, 0.0005);
  const RunResult unused = Import({}, {"--images", folder_ / "ct"});
  EXPECT_EQ(unused.exit_code, 0) << unused.err;
  EXPECT_THAT(unused.out,
              HasSubstr("the CT images were not used: the surface is that of the contour BODY"));
  // One image of another series spoils all of them, and leaves nothing behind.
  CtImage other = SmallImages(options).front();
  other.series_uid = "2.25.3";
  Written(folder_ / "ct" / "other", DicomBytes(other));
  const RunResult mixed = Plumb({"import-dicom", folder_ / "plan.dcm", "--images", folder_ / "ct",
                                 "--out", folder_ / "mixed"});
  EXPECT_EQ(mixed.exit_code, 3);
  EXPECT_THAT(mixed.err, HasSubstr("of another series"));
  EXPECT_FALSE(fs::exists(folder_ / "mixed"));
}

// Images alone, with a couch beneath the body, become a reference; a sweep is compared with it.
TEST_F(PlanningCtTest, FromImagesToSixNumbersInACalibratedRoom) {
  const fs::path suite = SmallCtSuite();
  ASSERT_EQ(Plumb({"simulate", "--suite", "ct", "--frames", "2", "--size", "320x240", "--seed", "5",
                   "--unit", "5", "--ct-images", "--ct-quirk", "short", "--ct-spacing", "5",
                   "--out", folder_ / "images"})
                .exit_code,
            0);
  json plan = json::parse(ReadText(suite / "suite.json"));
  plan["pairs"] =
      json::array({json::array({"ct_HFS", "placement_1"}), json::array({"ct_FFP", "placement_1"})});
  plan["scenes"] = {"ct_HFS", "ct_FFP", "placement_1"};
  fs::create_directory(folder_ / "recordings");
  fs::create_symlink(suite / "truth", folder_ / "truth");
  for (const char* name : {"ct_HFS", "ct_FFP"}) {
    EXPECT_FALSE(fs::exists(folder_ / "images/recordings" / name / "structures.dcm"));
    fs::create_symlink(folder_ / "images/recordings" / name, folder_ / "recordings" / name);
  }
  fs::create_symlink(suite / "recordings/placement_1", folder_ / "recordings/placement_1");
  for (const char* part : {"room", "room.toml"}) fs::create_symlink(suite / part, folder_ / part);
  WriteText(folder_ / "suite.json", plan.dump());
  const json total = Evaluated();
  // Measured: 0.15 deg, all inside. It is one short sweep: of the 40 pairs of a whole suite (unit
  // 51) the worst has 1.4 mm and 0.05 deg.
  EXPECT_LT(total.at("translation_mm").at("max").get<double>(), 1.6);
  EXPECT_LT(total.at("rotation_deg").at("max").get<double>(), 0.2);
  EXPECT_GE(total.at("intervals_95").at("all").at("inside").get<int>(), 11) << "of 12";
}

TEST_F(PlanningCtTest, AnOlderPlanInPlaceOfALaterOneIsSaid) {
  ASSERT_EQ(Import({}).exit_code, 0);
  auto [structures, plan] = SmallCt();
  plan.file.date = "20251231 080000";
  const RunResult older =
      Plumb({"import-dicom", Written(folder_ / "structures.dcm", DicomBytes(structures)),
             Written(folder_ / "plan.dcm", DicomBytes(plan)), "--out", folder_ / "planned"});
  EXPECT_EQ(older.exit_code, 0) << older.err;
  EXPECT_THAT(older.out, HasSubstr("is this one superseded?"));
}

TEST_F(PlanningCtTest, InfoDescribesTheFilesWithoutThePatient) {
  ASSERT_EQ(Import({}).exit_code, 0);
  const RunResult structures = Plumb({"info", folder_ / "structures.dcm", "--json"});
  ASSERT_EQ(structures.exit_code, 0) << structures.err;
  EXPECT_EQ(json::parse(structures.out).at("rois").at("BODY").at("type"), "EXTERNAL");
  const RunResult plan = Plumb({"info", folder_ / "plan.dcm", "--json"});
  const json facts = json::parse(plan.out);
  EXPECT_EQ(facts.at("positions"), json({"HFS"}));
  EXPECT_NEAR(facts.at("beams").at("AP").at("isocentre_lps_mm").at(1), -304.3, 1e-9);
  const RunResult image =
      Plumb({"info", Written(folder_ / "image.dcm", DicomBytes(SmallImages().front())), "--json"});
  EXPECT_EQ(json::parse(image.out).at("position"), "HFS");
  EXPECT_EQ(json::parse(image.out).at("pixel_mm"), json({5.0, 5.0}));
  for (const RunResult* result : {&structures, &plan, &image}) {
    EXPECT_EQ(result->out.find("SIM-1"), std::string::npos);
    EXPECT_EQ(result->out.find("Simulated^Body"), std::string::npos);
  }
}

// The files of each position become a reference, and one sweep is compared with each of them.
TEST_F(PlanningCtTest, FromTheFilesToSixNumbersInACalibratedRoom) {
  const fs::path suite = SmallCtSuite();
  for (const char* part : {"recordings", "truth", "room", "room.toml"})
    fs::create_symlink(suite / part, folder_ / part);
  json plan = json::parse(ReadText(suite / "suite.json"));
  json scenes = json::array(), pairs = json::array();
  for (const json& pair : plan.at("pairs")) {
    if (pair.at(1) != "placement_1") continue;
    pairs.push_back(pair);
    scenes.push_back(pair.at(0));
  }
  ASSERT_EQ(pairs.size(), 4U);
  scenes.push_back("placement_1");
  plan["pairs"] = pairs;
  plan["scenes"] = scenes;
  WriteText(folder_ / "suite.json", plan.dump());
  const json total = Evaluated();
  // 320 x 240 and 50 frames in 10 s. Measured: 1.57 mm, 0.06 deg, all inside.
  EXPECT_LT(total.at("translation_mm").at("max").get<double>(), 2.0);
  EXPECT_LT(total.at("rotation_deg").at("max").get<double>(), 0.1);
  EXPECT_GE(total.at("intervals_95").at("all").at("inside").get<int>(), 23) << "of 24";
}

TEST_F(PlanningCtTest, WhatIsStatedOfTheSurfaceHasLimits) {
  for (const char* option : {"--clothing-mm", "--ct-breathing-mm"}) {
    fs::remove_all(folder_ / "planned");
    for (const char* wrong : {"-0.1", "30.1", "nan", "inf", "thick"}) {
      const RunResult refused = Import({}, {option, wrong});
      EXPECT_EQ(refused.exit_code, 2) << option << wrong;
      EXPECT_THAT(refused.err, HasSubstr(option));
      EXPECT_FALSE(fs::exists(folder_ / "planned")) << option << wrong;
    }
    for (const char* right : {"0", "30"})
      EXPECT_EQ(Import({}, {option, right}).exit_code, 0) << option << right;
  }
}

// From the number that a person states to the interval that it widens, and nothing else.
TEST_F(PlanningCtTest, ClothingAndTheBreathOfTheCtWidenTheIntervals) {
  const fs::path suite = SmallCtSuite(), ct = suite / "recordings/ct_HFS";
  ASSERT_EQ(Plumb({"reconstruct", suite / "recordings/placement_1", "--out", folder_ / "current"})
                .exit_code,
            0);
  const auto result_of = [&](const std::vector<std::string>& stated) {
    std::vector<std::string> arguments = {"import-dicom", ct / "structures.dcm", ct / "plan.dcm",
                                          "--out", folder_ / "planned"};
    arguments.insert(arguments.end(), stated.begin(), stated.end());
    const RunResult imported = Plumb(arguments);
    EXPECT_EQ(imported.exit_code, 0) << imported.err;
    const RunResult compared =
        Plumb({"compare", folder_ / "planned", folder_ / "current", "--config", suite / "room.toml",
               "--out", folder_ / "result", "--json"});
    EXPECT_THAT(compared.exit_code, testing::AnyOf(0, 4)) << compared.err;
    return json::parse(compared.out);
  };
  const json bare = result_of({});
  const json stated = result_of({"--clothing-mm", "5", "--ct-breathing-mm", "7.5"});
  EXPECT_EQ(ReadScene(folder_ / "planned").planning->surface.ct_breathing_u95_m, 0.0075);
  EXPECT_THAT(ReadText(folder_ / "result" / "result.json"), HasSubstr("clothing_mm"));
  EXPECT_EQ(stated.at("compared_with").at("clothing_mm"), 5);
  EXPECT_EQ(stated.at("compared_with").at("ct_breathing_mm"), 7.5);
  EXPECT_FALSE(bare.at("motion").at("covariance_parts").contains("clothing"));
  EXPECT_TRUE(stated.at("motion").at("covariance_parts").contains("ct_breathing"));
  const auto half = [](const json& result, const char* number) {
    return result.at("correction").at("uncertainty").at(number).get<double>();
  };
  EXPECT_LT(half(bare, "vertical_mm"), 4);
  EXPECT_GT(half(stated, "vertical_mm"), 8.5);
  EXPECT_GT(half(stated, "pitch_deg"), 2 * half(bare, "pitch_deg"));
  EXPECT_NE(bare.at("verdict"), "no_answer");
  EXPECT_EQ(stated.at("verdict"), "no_answer") << "more than the tolerance is stated";
  EXPECT_THAT(stated.at("reasons").dump(), HasSubstr("the CT may be of another breath"));
  EXPECT_EQ(stated.at("motion").at("T"), bare.at("motion").at("T"));
  EXPECT_EQ(
      result_of({"--clothing-mm", "0", "--ct-breathing-mm", "0"}).at("motion").at("covariance"),
      bare.at("motion").at("covariance"))
      << "bit for bit";
}

TEST_F(PlanningCtTest, WithoutACalibratedRoomThereIsNoAnswer) {
  ASSERT_EQ(Import({}).exit_code, 0);
  const RunResult result = Plumb({"compare", folder_ / "planned", SmallScene(SmallNames().back()),
                                  "--out", folder_ / "result", "--json"});
  EXPECT_EQ(result.exit_code, 4) << result.err;
  const json told = json::parse(result.out);
  EXPECT_EQ(told.at("verdict"), "no_answer");
  EXPECT_THAT(told.at("reasons").at(0).get<std::string>(), HasSubstr("T_iec_reference"));
  EXPECT_EQ(told.at("compared_with").at("source"), "dicom");
  EXPECT_TRUE(fs::exists(folder_ / "result" / "result.json"));
}

TEST_F(PlanningCtTest, AResultIsExportedWithACodeOrTheGivenIdentity) {
  const fs::path reference = SmallScene(SmallNames().front()), current = SmallScene("moved");
  ASSERT_EQ(Plumb({"compare", reference, current, "--out", folder_ / "result"}).exit_code, 0);
  const std::vector<std::string> line = {"export-dicom", folder_ / "result",  "--reference",
                                         reference,      "--current",         current,
                                         "--out",        folder_ / "exported"};
  const RunResult exported = Plumb(line);
  ASSERT_EQ(exported.exit_code, 0) << exported.err;
  EXPECT_THAT(exported.out, HasSubstr("5 DICOM files"));
  for (const char* name : {"report", "error_map", "overlay", "surface", "registration"}) {
    const RunResult told =
        Plumb({"info", folder_ / "exported" / (std::string(name) + ".dcm"), "--json"});
    EXPECT_EQ(told.exit_code, 0) << name << told.err;
  }
  // The surface is the scene's, in millimetres.
  WriteMeshFile(folder_ / "scene.stl", ReadScene(current, {.mesh = true}).mesh,
                MeshUnit::kMillimetres);
  EXPECT_THAT(ReadText(folder_ / "exported" / "surface.dcm"),
              HasSubstr(ReadText(folder_ / "scene.stl")));
  const std::string report = ReadText(folder_ / "exported" / "report.dcm");
  EXPECT_THAT(report, HasSubstr("PLUMB-"));
  // Named, and with a report of its own; what is no PDF is refused and leaves what is there.
  std::vector<std::string> named = line;
  WriteText(folder_ / "own.pdf", "%PDF-1.4 own report");
  for (const std::string& word :
       {std::string("--patient-id"), std::string("X7"), std::string("--patient-name"),
        std::string("Doe^Jo"), std::string("--report"), (folder_ / "own.pdf").string()})
    named.push_back(word);
  ASSERT_EQ(Plumb(named).exit_code, 0);
  const std::string own = ReadText(folder_ / "exported" / "report.dcm");
  EXPECT_THAT(own, HasSubstr("Doe^Jo"));
  EXPECT_THAT(own, HasSubstr("%PDF-1.4 own report"));
  EXPECT_EQ(own.find("PLUMB-"), std::string::npos);
  WriteText(folder_ / "own.pdf", "a letter");
  const RunResult letter = Plumb(named);
  EXPECT_EQ(letter.exit_code, 3);
  EXPECT_THAT(letter.err, HasSubstr("no PDF"));
  EXPECT_EQ(ReadText(folder_ / "exported" / "report.dcm"), own);
}

TEST_F(PlanningCtTest, AResultWithoutAnAnswerHasNoPlaceInTheCt) {
  ASSERT_EQ(Import({}).exit_code, 0);
  const fs::path current = SmallScene(SmallNames().back());
  ASSERT_EQ(Plumb({"compare", folder_ / "planned", current, "--out", folder_ / "result"}).exit_code,
            4);
  const RunResult exported =
      Plumb({"export-dicom", folder_ / "result", "--reference", folder_ / "planned", "--current",
             current, "--out", folder_ / "exported"});
  ASSERT_EQ(exported.exit_code, 0) << exported.err;
  EXPECT_THAT(exported.out, HasSubstr("no spatial registration"));
  EXPECT_FALSE(fs::exists(folder_ / "exported" / "registration.dcm"));
  const RunResult other = Plumb({"export-dicom", folder_ / "result", "--reference", current,
                                 "--current", current, "--out", folder_ / "other"});
  EXPECT_EQ(other.exit_code, 3);
  EXPECT_THAT(other.err, HasSubstr("not compared with the scene"));
  EXPECT_FALSE(fs::exists(folder_ / "other"));
}

double DistanceFrom(const std::vector<Eigen::Vector3d>& contour, const Eigen::Vector3d& p) {
  double nearest = 1e9;
  for (std::size_t i = 0, j = contour.size() - 1; i < contour.size(); j = i++) {
    const Eigen::Vector3d along = contour[i] - contour[j], q = p - contour[j];
    const double share = std::clamp(q.dot(along) / std::max(along.squaredNorm(), 1e-12), 0.0, 1.0);
    nearest = std::min(nearest, (q - share * along).norm());
  }
  return nearest;
}

TEST_F(PlanningCtTest, TheSkinOfARealImageIsThePlanningSystemsContour) {
  PLUMB_SHARED_DATA(real, "dicom-real");
  const PlanningContent content = ReadDicomFile(real / "ct.0.dcm");
  ASSERT_TRUE(content.image);
  CtSkin skin;
  skin.Add(*content.image, "image");
  const StructureSet structures = ReadStructureSet(real / "rtss.dcm");
  const auto largest = [&](const PlannedRoi& roi) {
    const PlannedContour* found = nullptr;
    for (const PlannedContour& contour : roi.contours) {
      if (std::abs(contour.points_mm.front().z() - content.image->origin_mm.z()) < 0.01 &&
          (found == nullptr || contour.points_mm.size() > found->points_mm.size()))
        found = &contour;
    }
    return found;
  };
  const auto body = std::ranges::find(structures.rois, "BODY", &PlannedRoi::name);
  ASSERT_NE(body, structures.rois.end());
  const PlannedContour* const drawn = largest(*body);
  const PlannedContour* const found = largest(skin.roi());
  ASSERT_TRUE(drawn != nullptr && found != nullptr);
  double middle = 0.0;
  for (const Eigen::Vector3d& p : drawn->points_mm)
    middle += p.y() / static_cast<double>(drawn->points_mm.size());
  std::vector<double> off_mm;  // of the upper side, which has no couch
  for (const Eigen::Vector3d& p : found->points_mm)
    if (p.y() < middle) off_mm.push_back(DistanceFrom(drawn->points_mm, p));
  ASSERT_GT(off_mm.size(), 200U);
  std::ranges::sort(off_mm);
  // Measured: 0.17 mm, 95 %: 0.9 mm, 235 HU/mm.
  EXPECT_LT(off_mm[off_mm.size() / 2], 0.3);
  EXPECT_LT(off_mm[off_mm.size() * 95 / 100], 1.5);
  EXPECT_NEAR(skin.Steepness(), 235, 60);
}

TEST_F(PlanningCtTest, ARealPlanIsImported) {
  PLUMB_SHARED_DATA(real, "dicom-real");
  const RunResult result = Plumb({"import-dicom", real / "rtss.dcm", real / "rtplan.dcm", "--out",
                                  folder_ / "planned", "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json planning = json::parse(result.out).at("planning");
  EXPECT_EQ(planning.at("roi"), "BODY");
  EXPECT_EQ(planning.at("posture"), "HFS");
  EXPECT_EQ(planning.at("slices"), 98);
  EXPECT_NEAR(planning.at("slice_spacing_m"), 0.003, 1e-9);
  const std::array<double, 3> isocentre = {72.530, -304.345, -9.309};
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_NEAR(planning.at("isocentre_lps_mm").at(i), isocentre[i], 5e-4);
  // The surface lies within the body's box and reaches its top, 115.1 mm above the isocentre.
  const Scene scene = ReadScene(folder_ / "planned");
  Eigen::Vector3f low = scene.cloud.points.front(), high = low;
  for (const Eigen::Vector3f& p : scene.cloud.points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  EXPECT_GE(low.x(), -0.302F);
  EXPECT_LE(high.x(), 0.1722F);
  EXPECT_NEAR(low.y(), -0.1131F + 0.003F, 0.003F);
  EXPECT_NEAR(high.y(), 0.1779F - 0.003F, 0.003F);
  EXPECT_NEAR(high.z(), 0.1151F, 0.002F);
}

}  // namespace
}  // namespace plumb
