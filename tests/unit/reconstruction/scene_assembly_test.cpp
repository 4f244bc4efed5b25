#include "algo/reconstruction/scene_assembly.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace plumb {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

TEST(SceneAssemblyTest, ALengthThatDepthAndMarkersDisagreeAboutIsAWarning) {
  const auto warnings_at = [](double depth_scale, bool has_markers = true) {
    Scene scene;
    if (has_markers) scene.markers[7] = {};
    WarnOfScale(depth_scale, scene);
    return scene.warnings;
  };
  for (const double usual : {1.0, 1.0199, 0.9801}) EXPECT_THAT(warnings_at(usual), IsEmpty());
  EXPECT_THAT(warnings_at(1.0201), ElementsAre(HasSubstr("disagree by 2.0 %")));
  EXPECT_THAT(warnings_at(0.9799), ElementsAre(HasSubstr("disagree by 2.0 %")));
  EXPECT_THAT(warnings_at(1.05, false), IsEmpty()) << "nothing to disagree with";
}

}  // namespace
}  // namespace plumb
