// SPDX-License-Identifier: Apache-2.0
// Damaged files: whatever stands in them, they are read or refused, and nothing crashes.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cstdint>
#include <random>

#include "algo/base/errors.hpp"
#include "algo/planning/planned_scene.hpp"
#include "drivers/dicom/planning_files.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/dicom/small_files.hpp"
#include "words/dicom.hpp"

namespace plumb {
namespace {

// Bytes changed, a part cut out, a part twice, a length made large, or the end missing.
std::string Damaged(std::string bytes, std::mt19937& random) {
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random()) % n; };
  const std::size_t changes = 1 + below(4);
  for (std::size_t i = 0; i < changes && bytes.size() > 200; ++i) {
    const std::size_t at = 132 + below(bytes.size() - 132 - 8), length = 1 + below(40);
    switch (below(6)) {
      case 0:
        bytes[at] = static_cast<char>(below(256));
        break;
      case 1:
        bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(8)));
        break;
      case 2:
        bytes.erase(at, length);
        break;
      case 3:
        bytes.insert(at, bytes.substr(at, length));
        break;
      case 4:
        for (std::size_t k = 0; k < 4; ++k) bytes[at + k] = static_cast<char>(0xFF);
        break;
      default:
        if (below(8) == 0) bytes.resize(at);
    }
  }
  return bytes;
}

void ExpectSmallReaders() {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  rusage children{};
  ASSERT_EQ(::getrusage(RUSAGE_CHILDREN, &children), 0);
  EXPECT_LT(children.ru_maxrss, 200 * 1024) << "kB, of the largest reader";
#endif
}

TEST(DamagedFilesTest, FiveHundredDamagedFilesAreReadOrRefused) {
  const testing::TempFolder folder;
  const auto [structures, plan] = SmallCt();
  const std::string structure_bytes = DicomBytes(structures), plan_bytes = DicomBytes(plan);
  std::mt19937 random(47);
  int read = 0, refused = 0;
  for (int i = 0; i < 500; ++i) {
    const bool of_plan = i % 3 == 0;
    const auto file = Written(folder.path() / "damaged.dcm",
                              Damaged(of_plan ? plan_bytes : structure_bytes, random));
    try {
      const PlanningContent content = ReadDicomFile(file);
      ++read;
      (void)MakePlannedScene(content.structures.value_or(structures), content.plan.value_or(plan));
    } catch (const DataError& error) {
      ++refused;
      EXPECT_EQ(std::string(error.what()).find("crashed"), std::string::npos)
          << "file " << i << ": " << error.what();
    }
  }
  EXPECT_GT(read, 30);  // measured: 64
  EXPECT_GT(refused, 100);
  ExpectSmallReaders();
}

TEST(DamagedFilesTest, FiveHundredDamagedImagesAreReadOrRefused) {
  const testing::TempFolder folder;
  const std::vector<CtImage> images = SmallImages();
  const std::string bytes = DicomBytes(images.front());
  // Damage to pixels is only another image.
  const std::size_t facts = bytes.size() - 2 * images.front().hu.size();
  std::mt19937 random(48);
  int read = 0, refused = 0;
  for (int i = 0; i < 500; ++i) {
    const auto file = Written(folder.path() / "damaged.dcm",
                              Damaged(bytes.substr(0, facts), random) + bytes.substr(facts));
    try {
      const PlanningContent content = ReadDicomFile(file);
      if (content.image) {
        CtSkin skin;
        skin.Add(*content.image, "image");
        EXPECT_LE(skin.roi().contours.size(), images.front().hu.size());
      }
      content.image ? ++read : ++refused;
    } catch (const DataError& error) {
      ++refused;
      EXPECT_EQ(std::string(error.what()).find("crashed"), std::string::npos)
          << "file " << i << ": " << error.what();
    }
  }
  EXPECT_GT(read, 30);
  EXPECT_GT(refused, 100);
  ExpectSmallReaders();
}

}  // namespace
}  // namespace plumb
