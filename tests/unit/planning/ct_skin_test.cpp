// SPDX-License-Identifier: Apache-2.0
// The skin in CT images, the couch beneath it, and the scene that they give.
#include "algo/planning/ct_skin.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "algo/base/errors.hpp"
#include "algo/planning/contour_surface.hpp"
#include "algo/planning/couch_top.hpp"
#include "algo/planning/planned_scene.hpp"
#include "drivers/simulator/suites/ct_images.hpp"
#include "drivers/simulator/suites/planned_scenes.hpp"
#include "drivers/simulator/suites/planning_ct.hpp"
#include "tests/unit/planning/torso.hpp"
#include "words/planning.hpp"

namespace plumb {
namespace {

using simulated::CtImageOptions;
using simulated::CtQuirk;
using simulated::PlanningCtOptions;
using ::testing::Contains;
using ::testing::Not;
using testing::PlaceOfTorso;
using testing::Torso;
using ::testing::Truly;

auto Warns(const MessageId& id) {
  return Contains(Truly([id](const Message& message) { return message.Is(id); }));
}

/// A region of 30 cm, so that a test takes a second.
PlanningCtOptions Region(std::vector<CtQuirk> quirks = {}) {
  quirks.push_back(CtQuirk::kShort);
  return {.spacing_m = 0.005, .quirks = std::move(quirks)};
}

/// What a test may change before the images are used.
struct CtFiles {
  std::optional<StructureSet> structures;
  TreatmentPlan plan;
  std::vector<CtImage> images;
};

CtFiles FilesOf(const PlanningCtOptions& options, const CtImageOptions& of_images = {}) {
  CtFiles files;
  StructureSet structures;
  std::tie(structures, files.plan) =
      simulated::MakePlanningCt(Torso().surface, PlaceOfTorso(), options);
  simulated::MakeCtImages(structures, options, of_images,
                          [&](const CtImage& image) { files.images.push_back(image); });
  return files;
}

Scene SceneOf(const CtFiles& files, double threshold_hu = kSkinThreshold_hu) {
  CtSkin skin(threshold_hu);
  for (const CtImage& image : files.images) skin.Add(image, "image");
  return MakePlannedScene(files.structures, files.plan, skin);
}

Message RefusalOf(const CtFiles& files) {
  try {
    (void)SceneOf(files);
  } catch (const DataError& error) {
    return error.message();
  }
  return {};
}

// Signed distances of a scene's points from the body's surface, outside positive.
std::vector<double> OffBody(const Scene& scene) {
  const Pose T_body = PlaceOfTorso().inverse();
  std::vector<double> off;
  for (const Eigen::Vector3f& p : scene.cloud.points)
    off.push_back(double{Torso().grid->Distance((T_body * p.cast<double>()).cast<float>().eval())});
  std::ranges::sort(off);
  return off;
}

TEST(CtSkinTest, InEveryPositionTheSkinLiesWhereTheBodyDoesAndTheCouchIsGone) {
  for (const std::string_view position : kNamesOf<PatientPosture>) {
    PlanningCtOptions options = Region();
    options.posture = Named<PatientPosture>(position).value();
    const Scene scene = SceneOf(FilesOf(options));
    const std::vector<double> off = OffBody(scene);
    ASSERT_GT(off.size(), 15000U) << position;
    // At -300 HU the skin lies 0.3 mm inside the middle of its blurred edge (0.6 mm).
    EXPECT_NEAR(off[off.size() / 2], -0.0003, 0.0002) << position;
    // Between slices of 5 mm it is interpolated: a few points lie 3.6 mm inside.
    EXPECT_GT(off[off.size() / 100], -0.0015) << position;
    EXPECT_GT(off.front(), -0.005) << position;
    EXPECT_LT(off.back(), 0.002) << position;
    EXPECT_THAT(scene.warnings, Warns(say::planning::kCouchRemoved));
    EXPECT_THAT(scene.warnings, Warns(say::planning::kSkinOfImages));
    EXPECT_THAT(scene.warnings, Warns(say::planning::kImagesByFrame));
    EXPECT_EQ(scene.planning->roi, "CT -300 HU");
    EXPECT_EQ(Name(scene.planning->posture), position);
    // The interval of the skin covers that, and is not much wider.
    EXPECT_GT(scene.planning->skin_u95_m, 0.0003);
    EXPECT_LT(scene.planning->skin_u95_m, 0.0008);
  }
}

TEST(CtSkinTest, TheThresholdMovesTheSkinAndTheBlurWidensItsInterval) {
  const CtFiles files = FilesOf(Region());
  const std::vector<double> darker = OffBody(SceneOf(files, -800)), skin = OffBody(SceneOf(files));
  EXPECT_GT(darker[darker.size() / 2], skin[skin.size() / 2] + 0.0004);
  const Scene blurred = SceneOf(FilesOf(Region(), {.blur_mm = 1.5}));
  EXPECT_GT(blurred.planning->skin_u95_m, 1.5 * SceneOf(files).planning->skin_u95_m);
  const Scene coarse = SceneOf(FilesOf(Region(), {.pixel_mm = 2.4}));
  EXPECT_GT(coarse.planning->skin_u95_m, 1.2 * SceneOf(files).planning->skin_u95_m);
}

TEST(CtSkinTest, WithoutACouchBesideTheBodyThatIsSaid) {
  const Scene scene = SceneOf(FilesOf(Region(), {.has_couch = false}));
  EXPECT_THAT(scene.warnings, Warns(say::planning::kCouchNotFound));
  EXPECT_GT(OffBody(scene).size(), 15000U);
  EXPECT_LT(OffBody(scene).back(), 0.002);
}

TEST(CtSkinTest, AContourOfTheCouchCountsMoreThanItsShape) {
  CtFiles files = FilesOf(Region());
  const Scene by_shape = SceneOf(files);
  // The planning system's couch lies 2 cm higher than what the images show.
  StructureSet& structures = files.structures.emplace();
  std::tie(structures, files.plan) =
      simulated::MakePlanningCt(Torso().surface, PlaceOfTorso(), Region({CtQuirk::kNoExternal}));
  PlannedRoi& couch = structures.rois.emplace_back();
  couch = {.number = 9, .name = "Couch", .type = "SUPPORT", .frame_of_reference_uid = "2.25.52"};
  const double y_mm = -304.3 - 1e3 * (by_shape.planning->support_m + 0.02);  // HFS
  for (const double z_mm : {-50.0, 0.0, 50.0})
    couch.contours.push_back({.kind = "CLOSED_PLANAR",
                              .points_mm = {{-200, y_mm, z_mm},
                                            {200, y_mm, z_mm},
                                            {200, y_mm + 30, z_mm},
                                            {-200, y_mm + 30, z_mm}}});
  const Scene drawn = SceneOf(files);
  EXPECT_NEAR(drawn.planning->support_m, by_shape.planning->support_m + 0.023, 0.001);
  EXPECT_THAT(drawn.warnings, Not(Warns(say::planning::kImagesByFrame)));
}

TEST(CtSkinTest, AnExternalContourIsTakenWhereThereIsOne) {
  CtFiles files = FilesOf(Region());
  files.structures = simulated::MakePlanningCt(Torso().surface, PlaceOfTorso(), Region()).first;
  EXPECT_EQ(SceneOf(files).planning->roi, "BODY");
}

TEST(CtSkinTest, AMissingImageIsAGap) {
  CtFiles files = FilesOf(Region());
  files.images.erase(files.images.begin() + 20);
  EXPECT_THAT(SceneOf(files).warnings, Warns(say::planning::kSliceGaps));
  for (std::size_t i = files.images.size() - 1; i > 0; --i)
    if (i % 2 == 0) files.images.erase(files.images.begin() + static_cast<std::ptrdiff_t>(i));
  EXPECT_TRUE(RefusalOf(files).Is(say::planning::kSpacingTooWide));
  files.images.resize(4);
  EXPECT_TRUE(RefusalOf(files).Is(say::planning::kFewSlices));
}

TEST(CtSkinTest, ImagesThatDoNotBelongTogetherAreRefused) {
  const CtFiles right = FilesOf(Region());
  const auto refused = [&](const MessageId& why, const std::function<void(CtFiles&)>& change) {
    CtFiles files = right;
    change(files);
    const Message message = RefusalOf(files);
    EXPECT_TRUE(message.Is(why)) << message.English();
  };
  const auto all = [](const std::function<void(CtImage&)>& change) {
    return [change](CtFiles& files) { std::ranges::for_each(files.images, change); };
  };
  namespace words = say::planning;
  refused(words::kImagesMixed, [](CtFiles& f) { f.images.back().series_uid = "2.25.3"; });
  refused(words::kImagesMixed,
          [](CtFiles& f) { f.images.back().file.frame_of_reference_uid = "2.25.53"; });
  refused(words::kImagesMixed, [](CtFiles& f) { f.images.back().position = "FFS"; });
  refused(words::kImagesOtherPatient, [](CtFiles& f) { f.images.back().file.patient_id = "X"; });
  refused(words::kImageTwice, [](CtFiles& f) { f.images.push_back(f.images.front()); });
  refused(words::kImageTilted, [](CtFiles& f) { f.images[3].along_column = {0, 0.98, 0.2}; });
  refused(words::kImageTilted, [](CtFiles& f) { f.images[3].along_row = {0, 0, 1}; });
  refused(words::kImagePixels, [](CtFiles& f) { f.images[3].row_spacing_mm = 0; });
  refused(words::kImagePixels, [](CtFiles& f) { f.images[3].hu.pop_back(); });
  refused(words::kImagesOtherPatient, all([](CtImage& i) { i.file.patient_id = "X"; }));
  refused(words::kOtherFrame, all([](CtImage& i) { i.file.frame_of_reference_uid = "2.25.53"; }));
  refused(words::kFrameMissing, [](CtFiles& files) {
    for (CtImage& image : files.images) image.file.frame_of_reference_uid.clear();
  });
  refused(words::kImagesPosition, all([](CtImage& i) { i.position = "HFP"; }));
  refused(words::kFewSlices, all([](CtImage& i) { std::ranges::fill(i.hu, -1000.0F); }));
}

/// An image of pixels of 1 mm in which `is_body` tells tissue from air.
CtImage Drawn(const std::function<bool(double x, double y)>& is_body) {
  CtImage image;
  image.rows = 120;
  image.columns = 200;
  image.row_spacing_mm = image.column_spacing_mm = 1.0;
  for (int row = 0; row < image.rows; ++row)
    for (int column = 0; column < image.columns; ++column)
      image.hu.push_back(is_body(column, row) ? 0.0F : -1000.0F);
  return image;
}

std::vector<double> AreasOf(const CtImage& image) {
  CtSkin skin;
  skin.Add(image, "image");
  std::vector<double> areas;
  for (const PlannedContour& contour : skin.roi().contours) {
    FlatContour flat;
    for (const Eigen::Vector3d& p : contour.points_mm) flat.emplace_back(p.x(), p.y());
    areas.push_back(AreaOf(flat));
  }
  std::ranges::sort(areas);
  return areas;
}

TEST(CtSkinTest, ArmsAreContoursOfTheirOwnAndLungsAreNone) {
  const auto within = [](double x, double y, double cx, double r) {
    return std::hypot(x - cx, y - 60) < r;
  };
  const std::vector<double> areas = AreasOf(Drawn([&](double x, double y) {
    const bool lung = within(x, y, 100, 15);
    return (within(x, y, 100, 45) && !lung) || within(x, y, 25, 20);
  }));
  ASSERT_EQ(areas.size(), 2U);
  EXPECT_NEAR(areas[0], std::numbers::pi * 20 * 20, 50);
  EXPECT_NEAR(areas[1], std::numbers::pi * 45 * 45, 100);
}

TEST(CtSkinTest, TheEdgeOfTheImageClosesWhatItCuts) {
  const std::vector<double> areas = AreasOf(Drawn([](double x, double) { return x < 50; }));
  ASSERT_EQ(areas.size(), 1U);
  EXPECT_NEAR(areas[0], 50 * 120, 100);
}

TEST(CtSkinTest, PixelsThatTouchByACornerAreApart) {
  const std::vector<double> areas = AreasOf(Drawn([](double x, double y) {
    return (x >= 20 && x < 40 && y >= 20 && y < 40) || (x >= 40 && x < 60 && y >= 40 && y < 60);
  }));
  EXPECT_EQ(areas.size(), 2U);
}

// Flanks of bodies are no couch, whatever their size; a level side of one slice is none either.
TEST(CouchTopTest, OnlyALevelSideAlongTheScanIsACouch) {
  const auto slices = [](const std::function<double(double x, int i)>& top) {
    std::vector<ContourSlice> made;
    for (int i = 0; i < 20; ++i) {
      ContourSlice& slice = made.emplace_back();
      slice.y_m = 0.003 * i;
      FlatContour& contour = slice.contours.emplace_back();
      for (int k = -300; k <= 300; ++k) contour.emplace_back(0.001 * k, top(0.001 * k, i));
      contour.emplace_back(0.3, -0.2);
      contour.emplace_back(-0.3, -0.2);
    }
    return made;
  };
  const auto round = [](double x, int) { return std::sqrt(std::max(0.0, 0.09 - x * x)); };
  EXPECT_FALSE(CouchTop(slices(round)));
  const auto on_couch = [](double x, int) {
    return std::abs(x) < 0.2 ? 0.05 + std::sqrt(0.04 - x * x) : 0.05;
  };
  ASSERT_TRUE(CouchTop(slices(on_couch)));
  EXPECT_NEAR(*CouchTop(slices(on_couch)), 0.05, 1e-6);
  EXPECT_FALSE(CouchTop(
      slices([&](double x, int i) { return i % 10 == 0 ? on_couch(x, i) : round(x, i); })));
  EXPECT_FALSE(CouchTop(slices([&](double x, int i) { return on_couch(x, i) + 0.01 * i; })));
  EXPECT_FALSE(CouchTop({}));
}

}  // namespace
}  // namespace plumb
