// SPDX-License-Identifier: Apache-2.0
#include "algo/monitoring/body_outline.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <opencv2/imgproc.hpp>

#include "algo/base/errors.hpp"
#include "algo/base/units.hpp"
#include "algo/monitoring/sensor_place.hpp"
#include "algo/monitoring/view_model.hpp"
#include "algo/motion/region.hpp"
#include "algo/surface/surface_mesh.hpp"
#include "words/monitoring.hpp"

namespace plumb {
namespace {

constexpr int kOutlineColumns = 320;  // of the picture that people see
constexpr double kOutlineStep_m = 6 * kMillimetre;
constexpr double kFinestLine_px = 0.7;
constexpr double kShortestLine_px = 12.0;

using PixelLine = std::vector<cv::Point>;

TriangleMesh BodyMesh(const Scene& scene) {
  if (!scene.height_map) throw DataError(say::monitoring::NoHeightMap());
  HeightMap body = *scene.height_map;
  const std::vector<std::uint8_t> region = ReferenceRegion(scene, {});
  bool is_there = false;
  for (std::size_t i = 0; i < region.size(); ++i) {
    if (region[i] != 0)
      is_there = true;
    else
      body.z[i] = std::numeric_limits<float>::quiet_NaN();
  }
  if (!is_there) throw DataError(say::monitoring::NoBody());
  const long decimation = std::max(1L, std::lround(kOutlineStep_m / body.grid.step));
  return MeshOfHeightMap(body, {}, {.decimation = static_cast<int>(decimation)});
}

/// The parts of a closed contour that are no border of the image.
std::vector<PixelLine> InsideImage(const PixelLine& contour, const cv::Size& size) {
  const auto is_border = [&](const cv::Point& p) {
    return p.x <= 0 || p.y <= 0 || p.x >= size.width - 1 || p.y >= size.height - 1;
  };
  const auto first = std::find_if(contour.begin(), contour.end(), is_border);
  if (first == contour.end()) {
    PixelLine closed = contour;
    closed.push_back(contour.front());
    return {closed};
  }
  PixelLine turned(first, contour.end());
  turned.insert(turned.end(), contour.begin(), first + 1);
  std::vector<PixelLine> lines(1);
  for (const cv::Point& p : turned) {
    if (!is_border(p))
      lines.back().push_back(p);
    else if (!lines.back().empty())
      lines.emplace_back();
  }
  return lines;
}

/// A ring ends where it begins, before as after.
PixelLine WithFewerPoints(const PixelLine& line) {
  const bool is_ring = line.front() == line.back();
  PixelLine few;
  for (double finest_px = kFinestLine_px; few.empty() || few.size() >= kMostOutlinePoints;
       finest_px *= 2)
    cv::approxPolyDP(is_ring ? PixelLine(line.begin(), line.end() - 1) : line, few, finest_px,
                     is_ring);
  if (is_ring) few.push_back(few.front());
  return few;
}

}  // namespace

OutlineLines OutlineOf(const TriangleMesh& body, const Pose& T_camera_mesh,
                       const Intrinsics& camera) {
  const int columns = std::min(kOutlineColumns, camera.width);
  const Intrinsics small = Resized(camera, columns, camera.height * columns / camera.width);
  cv::Mat seen = RenderDepth(body, T_camera_mesh, small) > 0;
  const cv::Mat around = cv::getStructuringElement(cv::MORPH_ELLIPSE, {5, 5});
  cv::morphologyEx(seen, seen, cv::MORPH_CLOSE, around);
  cv::morphologyEx(seen, seen, cv::MORPH_OPEN, around);
  std::vector<PixelLine> contours, lines;
  cv::findContours(seen, contours, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  for (const PixelLine& contour : contours) {
    for (PixelLine& line : InsideImage(contour, seen.size())) {
      if (line.size() >= kShortestLine_px) lines.push_back(std::move(line));
    }
  }
  std::sort(lines.begin(), lines.end(),
            [](const PixelLine& a, const PixelLine& b) { return a.size() > b.size(); });
  OutlineLines outline;
  std::size_t left = kMostOutlinePoints;
  for (const PixelLine& line : lines) {
    const PixelLine few = WithFewerPoints(line);
    if (few.size() > left) break;
    left -= few.size();
    std::vector<Eigen::Vector2f>& points = outline.emplace_back();
    for (const cv::Point& p : few)
      points.emplace_back((static_cast<float>(p.x) + 0.5F) / static_cast<float>(seen.cols),
                          (static_cast<float>(p.y) + 0.5F) / static_cast<float>(seen.rows));
  }
  return outline;
}

BodyOutline::BodyOutline(const Scene& scene, const std::string& dictionary, MarkerMap markers)
    : markers_(std::move(markers)),
      detector_(MarkerDictionary::ByName(dictionary)),
      body_(BodyMesh(scene)) {}

std::optional<OutlineLines> BodyOutline::In(const cv::Mat& color, const Intrinsics& camera) const {
  SeenCorners seen;
  for (const MarkerObservation& marker : detector_.Detect(color).markers)
    seen.emplace(marker.id, marker.corners);
  const std::optional<SensorPlace> place = PlaceByMarkers(seen, markers_, camera);
  if (!place) return std::nullopt;
  return OutlineOf(body_, place->T_camera_scene, camera);
}

}  // namespace plumb
