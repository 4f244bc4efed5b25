// SPDX-License-Identifier: Apache-2.0
// The skin in CT images, and the scene that they give.
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

Message RefusalOf(const CtFiles& files, double threshold_hu = kSkinThreshold_hu) {
  try {
    (void)SceneOf(files, threshold_hu);
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
    EXPECT_THAT(scene.warnings, Not(Warns(say::planning::kImagesCut)));
    EXPECT_EQ(scene.planning->roi, "CT -300 HU");
    EXPECT_EQ(scene.planning->skin_threshold_hu, -300);
    EXPECT_EQ(Name(scene.planning->posture), position);
    // The interval of the skin covers that, and is not much wider.
    EXPECT_GT(scene.planning->skin_u95_m, 0.0003);
    EXPECT_LT(scene.planning->skin_u95_m, 0.0008);
  }
}

// Without the rows and columns beyond those that stay.
CtImage Cropped(const CtImage& image, int first_row, int last_row, int first_column) {
  CtImage cropped = image;
  cropped.rows = last_row + 1 - first_row;
  cropped.columns = image.columns - first_column;
  cropped.origin_mm += first_row * image.row_spacing_mm * image.along_column +
                       first_column * image.column_spacing_mm * image.along_row;
  cropped.hu.clear();
  for (int row = first_row; row <= last_row; ++row) {
    const auto from = image.hu.begin() + std::ptrdiff_t{row} * image.columns;
    cropped.hu.insert(cropped.hu.end(), from + first_column, from + image.columns);
  }
  return cropped;
}

// The same image with its rows in the opposite order.
CtImage UpsideDown(const CtImage& image) {
  CtImage turned = image;
  turned.origin_mm += (image.rows - 1) * image.row_spacing_mm * image.along_column;
  turned.along_column = -image.along_column;
  for (int row = 0; row < image.rows; ++row)
    std::copy_n(image.hu.begin() + std::ptrdiff_t{row} * image.columns, image.columns,
                turned.hu.end() - std::ptrdiff_t{row + 1} * image.columns);
  return turned;
}

// What is left of a surface is on the body, and it is said that a part is left out.
void ExpectTrueButLess(const Scene& scene, const Scene& whole) {
  EXPECT_THAT(scene.warnings, Warns(say::planning::kImagesCut));
  EXPECT_LT(scene.cloud.size() + 1000, whole.cloud.size());
  ASSERT_GT(scene.cloud.size(), 300U);
  const std::vector<double> off = OffBody(scene);
  EXPECT_GT(off.front(), -0.005);  // as of whole images
  EXPECT_LT(off.back(), 0.002);
}

TEST(CtSkinTest, ABodyThatIsCutAtTheTopHasNoFlatSkinThere) {
  const CtFiles files = FilesOf(Region());
  const Scene whole = SceneOf(files);
  for (const int rows : {40, 60}) {  // 33 and 57 mm of the body
    for (const bool is_turned : {false, true}) {
      CtFiles cut = files;
      for (CtImage& image : cut.images) {
        image = Cropped(image, rows, image.rows - 1, 0);
        if (is_turned) image = UpsideDown(image);
      }
      const Scene scene = SceneOf(cut);
      ExpectTrueButLess(scene, whole);
      EXPECT_GT(scene.planning->skin_u95_m, 0.95 * whole.planning->skin_u95_m);
    }
  }
}

TEST(CtSkinTest, ARoundFieldOfViewCutsTheBodyAsAnEdgeDoes) {
  CtFiles files = FilesOf(Region());
  const Scene whole = SceneOf(files);
  for (CtImage& image : files.images) {
    for (int row = 0; row < image.rows; ++row)
      for (int column = 0; column < image.columns; ++column)
        if (std::hypot(row - 0.5 * image.rows, column - 0.5 * image.columns) > 0.52 * image.rows)
          image.hu[static_cast<std::size_t>(row) * static_cast<std::size_t>(image.columns) +
                   static_cast<std::size_t>(column)] = static_cast<float>(kNothing_hu);
  }
  ExpectTrueButLess(SceneOf(files), whole);
}

TEST(CtSkinTest, ASideThatIsCutIsNoSurfaceWhateverTissueLiesThere) {
  CtFiles files = FilesOf(Region());
  const Scene whole = SceneOf(files);
  for (CtImage& image : files.images) {
    image = Cropped(image, 0, image.rows - 1, 135);
    for (int row = 0; row < image.rows; ++row) {
      float& hu = image.hu[static_cast<std::size_t>(row) * static_cast<std::size_t>(image.columns)];
      if (hu > -200) hu = row % 32 < 16 ? 700.0F : -100.0F;  // bone and fat
    }
  }
  const Scene scene = SceneOf(files);
  ExpectTrueButLess(scene, whole);
  const CtImage& image = files.images.front();
  const auto edge = static_cast<float>(1e-3 * image.origin_mm.x());  // HFS, isocentre at x = 72.53
  for (const Eigen::Vector3f& p : scene.cloud.points) ASSERT_GT(p.x(), edge - 0.0725F + 0.010F);
}

TEST(CtSkinTest, TheThresholdMovesTheSkinAndTheBlurWidensItsInterval) {
  const CtFiles files = FilesOf(Region());
  const Scene at_800 = SceneOf(files, -800);
  const std::vector<double> darker = OffBody(at_800), skin = OffBody(SceneOf(files));
  EXPECT_GT(darker[darker.size() / 2], skin[skin.size() / 2] + 0.0004);
  // 300 HU from half-way in place of 200 HU. Measured: 0.68 and 0.52 mm.
  EXPECT_GT(at_800.planning->skin_u95_m, 1.2 * SceneOf(files).planning->skin_u95_m);
  const Scene blurred = SceneOf(FilesOf(Region(), {.blur_mm = 1.5}));
  EXPECT_GT(blurred.planning->skin_u95_m, 1.5 * SceneOf(files).planning->skin_u95_m);
  const Scene coarse = SceneOf(FilesOf(Region(), {.pixel_mm = 2.4}));
  EXPECT_GT(coarse.planning->skin_u95_m, 1.2 * SceneOf(files).planning->skin_u95_m);
}

// The limit is 3 mm for 200 HU: 67 HU/mm.
TEST(CtSkinTest, ImagesThatDoNotShowTheSkinAreRefused) {
  EXPECT_TRUE(RefusalOf(FilesOf(Region(), {.blur_mm = 3.5})).empty());
  const CtFiles blurred = FilesOf(Region(), {.blur_mm = 7.0});
  EXPECT_TRUE(RefusalOf(blurred).Is(say::planning::kImagesBlurred));
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
  for (const CtImage& image : files.images) {
    const double z_mm = image.origin_mm.z();
    couch.contours.push_back({.kind = "CLOSED_PLANAR",
                              .points_mm = {{-200, y_mm, z_mm},
                                            {200, y_mm, z_mm},
                                            {200, y_mm + 30, z_mm},
                                            {-200, y_mm + 30, z_mm}}});
  }
  const Scene drawn = SceneOf(files);
  EXPECT_THAT(drawn.warnings, Warns(say::planning::kCouchDrawn));
  EXPECT_THAT(drawn.warnings, Not(Warns(say::planning::kCouchRemoved)));
  EXPECT_THAT(drawn.warnings, Not(Warns(say::planning::kSupportsNotUsed)));
  EXPECT_NEAR(drawn.planning->support_m, by_shape.planning->support_m + 0.023, 0.001);
  EXPECT_THAT(drawn.warnings, Not(Warns(say::planning::kImagesByFrame)));
  // Planning systems draw the inside of its shell, rails and cushions as structures of their own.
  const double middle_mm = files.images[files.images.size() / 2].origin_mm.z();
  const auto add_support = [&](const std::string& name, double lower_mm, double rise_mm) {
    PlannedRoi part = structures.rois.back();
    part.name = name;
    for (PlannedContour& contour : part.contours)
      for (Eigen::Vector3d& p : contour.points_mm)
        p.y() += lower_mm - (p.z() > middle_mm ? rise_mm : 0.0);  // HFS: y points down
    structures.rois.insert(structures.rois.begin(), part);
    return SceneOf(files).planning->support_m;
  };
  for (const auto& [name, lower_mm, rise_mm] :
       {std::tuple{"inside", 8.0, 0.0}, {"rails", 60.0, 0.0}, {"cushion", -40.0, 30.0}})
    EXPECT_NEAR(add_support(name, lower_mm, rise_mm), drawn.planning->support_m, 1e-9) << name;
  EXPECT_THAT(SceneOf(files).warnings, Contains(say::planning::SupportsNotUsed({"cushion"})));
  // In another frame of reference its height says nothing.
  for (PlannedRoi& roi : structures.rois) roi.frame_of_reference_uid = "2.25.53";
  EXPECT_NEAR(SceneOf(files).planning->support_m, by_shape.planning->support_m, 1e-9);
}

TEST(CtSkinTest, WithAnExternalContourImagesAreCheckedAndSaidToBeUnused) {
  CtFiles files = FilesOf(Region());
  files.structures = simulated::MakePlanningCt(Torso().surface, PlaceOfTorso(), Region()).first;
  const Scene scene = SceneOf(files);
  EXPECT_EQ(scene.planning->roi, "BODY");
  EXPECT_FALSE(scene.planning->skin_threshold_hu);
  EXPECT_THAT(scene.warnings, Warns(say::planning::kImagesNotUsed));
  for (CtImage& image : files.images) image.position = "HFP";
  EXPECT_TRUE(RefusalOf(files).Is(say::planning::kImagesPosition));
  for (CtImage& image : files.images) image.file.patient_id = "X";
  EXPECT_TRUE(RefusalOf(files).Is(say::planning::kImagesOtherPatient));
  files = FilesOf(Region());
  files.structures = simulated::MakePlanningCt(Torso().surface, PlaceOfTorso(), Region()).first;
  for (CtImage& image : files.images) image.file.frame_of_reference_uid = "2.25.53";
  EXPECT_TRUE(RefusalOf(files).Is(say::planning::kOtherFrame));
}

TEST(CtSkinTest, AChosenContourNeedsAStructureSet) {
  const CtFiles files = FilesOf(Region());
  CtSkin skin;
  for (const CtImage& image : files.images) skin.Add(image, "image");
  try {
    (void)MakePlannedScene(std::nullopt, files.plan, skin, {.roi = "BODY"});
    FAIL() << "it was taken";
  } catch (const DataError& error) {
    EXPECT_TRUE(error.message().Is(say::planning::kRoiOfNone)) << error.what();
  }
}

TEST(CtSkinTest, AMissingImageIsRefusedWithItsPlace) {
  CtFiles files = FilesOf(Region());
  CtFiles ends = files;  // of a series nothing shows how long it was
  ends.images.erase(ends.images.begin());
  ends.images.pop_back();
  EXPECT_TRUE(RefusalOf(ends).empty());
  const double before_mm = files.images[19].origin_mm.z();
  files.images.erase(files.images.begin() + 20);
  EXPECT_EQ(RefusalOf(files), say::planning::ImagesMissing(before_mm, 10, 5));
  // Without the image in between two steps of unequal lengths are no gap: 5 and 7.4 mm.
  CtFiles moved = FilesOf(Region());
  moved.images[20].origin_mm.z() += 2.4;
  EXPECT_TRUE(RefusalOf(moved).empty());
  moved.images[20].origin_mm.z() += 0.2;
  EXPECT_TRUE(RefusalOf(moved).Is(say::planning::kImagesMissing));
}

TEST(CtSkinTest, AnImageThatIsMissingAtAnEndIsNoticedWhereTheStructureSetNamesIt) {
  CtFiles files = FilesOf(Region());
  files.structures =
      simulated::MakePlanningCt(Torso().surface, PlaceOfTorso(), Region({CtQuirk::kNoExternal}))
          .first;
  files.images.pop_back();
  EXPECT_TRUE(RefusalOf(files).empty()) << "nothing states how many images there were";
  files.structures->image_uids["2.25.3"] = {"2.25.404"};
  EXPECT_TRUE(RefusalOf(files).empty()) << "another series says nothing of this one";
  CtSkin skin(kSkinThreshold_hu);
  for (const CtImage& image : files.images) skin.Add(image, "image");
  EXPECT_TRUE(skin.IsOfAnotherSeries(*files.structures));
  EXPECT_FALSE(skin.IsOfAnotherSeries({})) << "one that names none says nothing";
  for (const CtImage& image : files.images)
    files.structures->image_uids[image.series_uid].push_back(image.file.instance_uid);
  EXPECT_TRUE(RefusalOf(files).empty()) << RefusalOf(files).English();
  EXPECT_FALSE(skin.IsOfAnotherSeries(*files.structures)) << "it is one of two";
  // The file may name one twice.
  files.structures->image_uids[files.images.front().series_uid].push_back(
      files.images.front().file.instance_uid);
  const auto count = static_cast<std::int64_t>(files.images.size());
  files.images.erase(files.images.begin(), files.images.begin() + 2);
  EXPECT_EQ(RefusalOf(files), say::planning::ImagesNamedMissing(count, 2));
}

TEST(CtSkinTest, ASeriesOfTwoSpacingsIsWhole) {
  PlanningCtOptions options = Region();
  options.spacing_m = 0.0025;
  CtFiles files = FilesOf(options);
  const std::size_t half = files.images.size() / 2;
  for (std::size_t i = files.images.size() - 1; i > half; --i)
    if ((i - half) % 2 == 1) files.images.erase(files.images.begin() + static_cast<long>(i));
  const Scene scene = SceneOf(files);
  EXPECT_THAT(scene.warnings, Not(Warns(say::planning::kSliceGaps)));
  const double off = OffBody(scene).front();
  EXPECT_GT(off, -0.005);
  // Both parts are there: as many points as of the one spacing.
  EXPECT_NEAR(static_cast<double>(scene.cloud.size()),
              static_cast<double>(SceneOf(FilesOf(options)).cloud.size()),
              0.03 * static_cast<double>(scene.cloud.size()));
  files.images.erase(files.images.begin() + static_cast<long>(half) + 5);
  EXPECT_TRUE(RefusalOf(files).Is(say::planning::kImagesMissing));
}

TEST(CtSkinTest, TooFewOrTooThinlySpreadImagesAreRefused) {
  CtFiles files = FilesOf(Region());
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
  refused(words::kImageFarOff, [](CtFiles& f) { f.images.back().origin_mm.x() = -1e4; });
  refused(words::kImageTilted, [](CtFiles& f) { f.images[3].along_column = {0, 0.98, 0.2}; });
  refused(words::kImageTilted, [](CtFiles& f) { f.images[3].along_row = {0, 0, 1}; });
  refused(words::kImagePixels, [](CtFiles& f) { f.images[3].row_spacing_mm = 0; });
  refused(words::kImagePixels, [](CtFiles& f) { f.images[3].row_spacing_mm = std::nan(""); });
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

CtSkin SkinOf(const CtImage& image) {
  CtSkin skin;
  skin.Add(image, "image");
  return skin;
}

std::vector<double> AreasOf(const CtImage& image) {
  const CtSkin skin = SkinOf(image);
  std::vector<double> areas;
  for (const PlannedContour& contour : skin.roi().contours)
    areas.push_back(AreaOf(InPlane(contour.points_mm)));
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

// Where the edge lies does not depend on the tissue, nor does it say how steep the skin is.
TEST(CtSkinTest, WhatTheEdgeCutsIsStraightWhateverIsCut) {
  const auto in_body = [](double x, double y) { return std::hypot(x, y - 60) < 40; };
  CtImage image = Drawn(in_body);
  for (std::size_t row = 0; row < 120; ++row) {
    float& hu = image.hu[200 * row];
    if (hu > -500) hu = row % 20 < 10 ? 1500.0F : -100.0F;
  }
  const CtSkin skin = SkinOf(image);
  ASSERT_EQ(skin.cuts_mm().size(), 1U);
  EXPECT_EQ(skin.cuts_mm().front().size(), 79U);
  for (const Eigen::Vector3d& p : skin.cuts_mm().front()) EXPECT_DOUBLE_EQ(p.x(), -0.5);
  EXPECT_DOUBLE_EQ(skin.Steepness(), 1000.0);
  EXPECT_TRUE(
      SkinOf(Drawn([&](double x, double y) { return in_body(x - 60, y); })).cuts_mm().empty());
}

TEST(CtSkinTest, ALungThatTheFirstRowOpensIsNoHole) {
  const CtSkin skin = SkinOf(Drawn([](double x, double y) {
    const double r = std::hypot(x - 100, y);
    return r < 45 && r > 15;
  }));
  ASSERT_EQ(skin.roi().contours.size(), 1U);
  EXPECT_NEAR(AreaOf(InPlane(skin.roi().contours.front().points_mm)),
              std::numbers::pi * 45 * 45 / 2, 60);
  // The whole row from side to side, 56 to 144.
  EXPECT_EQ(skin.cuts_mm().front().size(), 89U);
}

TEST(CtSkinTest, ARoundFieldOfViewNeedsNoPaddingValue) {
  // Of 200 pixels, and a body that reaches across its edge.
  CtImage image = Drawn([](double x, double y) { return x < 60 && y > 70; });
  image.rows = 200;
  image.hu.resize(std::size_t{200} * 200, -1000.0F);
  for (std::size_t i = 0; i < image.hu.size(); ++i)
    if (std::hypot(static_cast<double>(i % 200) - 99.5, static_cast<double>(i / 200) - 99.5) > 99)
      image.hu[i] = -1024.0F;
  const CtSkin skin = SkinOf(image);
  ASSERT_EQ(skin.cuts_mm().size(), 1U);
  EXPECT_GT(skin.cuts_mm().front().size(), 40U);
  for (const Eigen::Vector3d& p : skin.cuts_mm().front())
    EXPECT_NEAR(std::hypot(p.x() - 99.5, p.y() - 99.5), 99, 1.0);
  // With another value in a corner the circle is a part of the picture.
  image.hu.back() = -1000.0F;
  EXPECT_TRUE(SkinOf(image).cuts_mm().empty());
}

TEST(CtSkinTest, PixelsThatTouchByACornerAreApart) {
  const std::vector<double> areas = AreasOf(Drawn([](double x, double y) {
    return (x >= 20 && x < 40 && y >= 20 && y < 40) || (x >= 40 && x < 60 && y >= 40 && y < 60);
  }));
  EXPECT_EQ(areas.size(), 2U);
}

}  // namespace
}  // namespace plumb
