// SPDX-License-Identifier: Apache-2.0
#include "daemon/files/scene_folder.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <opencv2/core.hpp>
#include <stdexcept>

#include "algo/base/check_stop.hpp"
#include "algo/base/errors.hpp"
#include "daemon/files/ply_file.hpp"
#include "daemon/files/sensitivity_json.hpp"
#include "daemon/files/sha256.hpp"
#include "daemon/files/trajectory_file.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "words/output.hpp"
#include "words/scene_file.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxSceneBytes = std::size_t{16} << 20;
constexpr std::size_t kMaxTrajectoryBytes = std::size_t{64} << 20;

std::vector<StampedPose> ReadTrajectory(const fs::path& file) {
  return ParseTrajectory(ReadTextFile(file, kMaxTrajectoryBytes), file.string());
}

HeightMap ReadHeightMap(const fs::path& file, const GridShape& grid) {
  const cv::Mat values = ReadFloatTiff(file);
  if (values.cols != grid.width || values.rows != grid.height) {
    throw DataError(say::scene_file::SizeDiffers(file.string(), values.cols, values.rows,
                                                 grid.width, grid.height));
  }
  HeightMap map(grid);
  for (int row = 0; row < grid.height; ++row) {
    const auto* in = values.ptr<float>(row);
    for (int column = 0; column < grid.width; ++column) {
      if (std::isinf(in[column])) {
        throw DataError(say::scene_file::InfiniteHeight(file.string(), row, column));
      }
    }
    std::memcpy(map.z.data() + static_cast<std::size_t>(row) * static_cast<std::size_t>(grid.width),
                in, static_cast<std::size_t>(grid.width) * sizeof(float));
  }
  return map;
}

/// Refuses a file that is not the one with which the scene was written: it would be read as if it
/// belonged to it, and the numbers would be wrong without a word.
void CheckSum(const fs::path& file, const std::optional<SceneSums>& sums) {
  if (!sums) return;
  const auto stated = sums->find(file.filename());
  if (stated == sums->end()) throw DataError(say::scene_file::NotOfScene(file.string()));
  if (SumOfFile(file).sha256 != stated->second)
    throw DataError(say::scene_file::NotAsWritten(file.string()));
}

/// JSON cannot represent NaN, and an invalid pose must not be used for a patient: better no scene.
void CheckFinite(const Scene& scene) {
  for (const auto* poses : {&scene.keyframes, &scene.trajectory}) {
    for (const StampedPose& pose : *poses) {
      if (!std::isfinite(pose.time_s) || !IsFinite(pose.T_world_camera))
        throw std::invalid_argument("scene: a pose is not finite");
    }
  }
  for (const auto& [id, marker] : scene.markers) {
    for (const Eigen::Vector3d& corner : marker.corners) {
      if (!corner.allFinite())
        throw std::invalid_argument(fmt::format("scene: a corner of marker {} is not finite", id));
    }
  }
}

}  // namespace

OutputKind SceneOutput() {
  return {say::output::Scene(),
          "scene.json",
          {"scene.json", "trajectory.txt", "trajectory_all.txt", "cloud.ply", "heightmap.tiff",
           "mesh.ply", "sensitivity.json"}};
}

void WriteScene(const Scene& scene, const fs::path& folder, const std::stop_token& stop) {
  CheckFinite(scene);
  AtomicFolder output(folder, SceneOutput());
  WriteWholeFile(output.path() / "trajectory.txt", TrajectoryText(scene.keyframes));
  WriteWholeFile(output.path() / "trajectory_all.txt", TrajectoryText(scene.trajectory));
  CheckStop(stop);
  WriteCloudPly(output.path() / "cloud.ply", scene.cloud);
  CheckStop(stop);
  if (scene.height_map) {
    const HeightMap& map = *scene.height_map;
    // The image borrows the values and is only read.
    const cv::Mat values(map.grid.height, map.grid.width, CV_32FC1,
                         const_cast<float*>(map.z.data()));
    WriteFloatTiff(output.path() / "heightmap.tiff", values);
  }
  CheckStop(stop);
  if (!scene.mesh.vertices.empty()) WriteMeshPly(output.path() / "mesh.ply", scene.mesh);
  if (scene.sensitivity)
    WriteWholeFile(output.path() / "sensitivity.json", SensitivityJson(*scene.sensitivity));
  SceneSums sums;
  for (const fs::directory_entry& file : fs::directory_iterator(output.path()))
    sums[file.path().filename()] = SumOfFile(file, stop).sha256;
  WriteWholeFile(output.path() / "scene.json", SceneJson(scene, sums));
  CheckStop(stop);
  output.Commit();
}

std::string SceneText(const fs::path& folder) {
  return ReadTextFile(folder / "scene.json", kMaxSceneBytes);
}

StoredScene ReadStoredScene(const fs::path& folder) {
  return ParseSceneJson(SceneText(folder), (folder / "scene.json").string());
}

Scene ReadScene(const fs::path& folder, const SceneParts& parts) {
  if (!IsSceneFolder(folder)) {
    std::error_code error;
    throw DataError(fs::exists(folder, error) ? say::scene_file::NoScene(folder.string())
                                              : say::scene_file::Missing(folder.string()));
  }
  StoredScene stored = ReadStoredScene(folder);
  Scene scene = std::move(stored.scene);
  // A file's own fault is said before that it is another file than the scene's.
  const auto read = [&](const char* name, const auto& reader) {
    auto part = reader(folder / name);
    CheckSum(folder / name, stored.sums);
    return part;
  };
  const auto has = [&](const char* name) {
    std::error_code no_error;
    if (fs::exists(folder / name, no_error)) return true;
    if (stored.sums && stored.sums->contains(name))
      throw DataError(say::scene_file::PartMissing((folder / name).string()));
    return false;
  };
  scene.keyframes = read("trajectory.txt", ReadTrajectory);
  if (scene.keyframes.size() != stored.shape.num_keyframes) {
    throw DataError(say::scene_file::PosesDiffer(
        (folder / "trajectory.txt").string(), static_cast<std::int64_t>(scene.keyframes.size()),
        static_cast<std::int64_t>(stored.shape.num_keyframes)));
  }
  scene.trajectory = read("trajectory_all.txt", ReadTrajectory);
  // Absent in scenes of versions before 0.2 and in those without a calibration.
  if (has("sensitivity.json"))
    scene.sensitivity = read("sensitivity.json", [](const fs::path& file) {
      return ParseSensitivityJson(ReadTextFile(file, kMaxSceneBytes), file.string());
    });
  if (parts.cloud) scene.cloud = read("cloud.ply", ReadCloudPly);
  if (parts.height_map && stored.shape.grid)
    scene.height_map = read("heightmap.tiff", [&](const fs::path& file) {
      return ReadHeightMap(file, *stored.shape.grid);
    });
  if (parts.mesh && has("mesh.ply")) scene.mesh = read("mesh.ply", ReadMeshPly);
  return scene;
}

bool IsSceneFolder(const fs::path& folder) {
  std::error_code ignored;
  return fs::exists(folder / "scene.json", ignored);
}

}  // namespace plumb
