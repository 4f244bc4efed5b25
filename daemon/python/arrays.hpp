// SPDX-License-Identifier: Apache-2.0
// Exposes Plumb's values as numpy arrays. An array that shares memory keeps its owner alive.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <opencv2/core/mat.hpp>

#include "algo/types/height_map.hpp"
#include "algo/types/marker.hpp"
#include "algo/types/point_cloud.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

/// Read-only, because the memory belongs to a value that others may share.
template <typename Array>
Array ReadOnly(Array array) {
  pybind11::detail::array_proxy(array.ptr())->flags &=
      ~pybind11::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  return array;
}

/// An image as (height, width) or (height, width, channels).
template <typename Value, int kChannels>
pybind11::array ImageArray(const cv::Mat& image) {
  auto* shared = new cv::Mat(image);  // adds a reference to the pixels
  const pybind11::capsule owner(shared, [](void* mat) { delete static_cast<cv::Mat*>(mat); });
  std::vector<pybind11::ssize_t> shape = {image.rows, image.cols};
  std::vector<pybind11::ssize_t> strides = {static_cast<pybind11::ssize_t>(image.step[0]),
                                            static_cast<pybind11::ssize_t>(image.elemSize())};
  if (kChannels > 1) {
    shape.push_back(kChannels);
    strides.push_back(sizeof(Value));
  }
  return ReadOnly(pybind11::array_t<Value>(shape, strides,
                                           reinterpret_cast<const Value*>(shared->data), owner));
}

/// Points or normals as (n, 3), sharing the vector's memory.
inline pybind11::array VectorArray(const std::vector<Eigen::Vector3f>& values,
                                   const pybind11::object& owner) {
  static_assert(sizeof(Eigen::Vector3f) == 3 * sizeof(float));
  return ReadOnly(pybind11::array_t<float>(
      std::vector<pybind11::ssize_t>{static_cast<pybind11::ssize_t>(values.size()), 3},
      reinterpret_cast<const float*>(values.data()), owner));
}

inline pybind11::array ColorArray(const std::vector<Color>& colors, const pybind11::object& owner) {
  return ReadOnly(pybind11::array_t<std::uint8_t>(
      std::vector<pybind11::ssize_t>{static_cast<pybind11::ssize_t>(colors.size()), 3},
      reinterpret_cast<const std::uint8_t*>(colors.data()), owner));
}

inline pybind11::array TriangleArray(const TriangleMesh& mesh, const pybind11::object& owner) {
  return ReadOnly(pybind11::array_t<std::uint32_t>(
      std::vector<pybind11::ssize_t>{static_cast<pybind11::ssize_t>(mesh.triangles.size()), 3},
      reinterpret_cast<const std::uint32_t*>(mesh.triangles.data()), owner));
}

/// A map as (rows, columns), sharing its memory; None without a map.
inline pybind11::object MapArray(const std::optional<HeightMap>& map,
                                 const pybind11::object& owner) {
  if (!map) return pybind11::none();
  return ReadOnly(pybind11::array_t<float>(
      std::vector<pybind11::ssize_t>{map->grid.height, map->grid.width}, map->z.data(), owner));
}

inline pybind11::object GridDict(const std::optional<HeightMap>& map) {
  if (!map) return pybind11::none();
  pybind11::dict grid;
  grid["x_min"] = map->grid.x_min;
  grid["y_min"] = map->grid.y_min;
  grid["step"] = map->grid.step;
  return grid;
}

/// (n, 4, 4), copied, because poses are stored together with their times.
inline pybind11::array_t<double> PoseArray(const std::vector<StampedPose>& poses) {
  pybind11::array_t<double> array(
      std::vector<pybind11::ssize_t>{static_cast<pybind11::ssize_t>(poses.size()), 4, 4});
  auto values = array.mutable_unchecked<3>();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Eigen::Matrix4d matrix = poses[i].T_world_camera.matrix();
    for (int row = 0; row < 4; ++row)
      for (int column = 0; column < 4; ++column)
        values(static_cast<pybind11::ssize_t>(i), row, column) = matrix(row, column);
  }
  return array;
}

inline pybind11::array_t<double> TimeArray(const std::vector<StampedPose>& poses) {
  pybind11::array_t<double> array(static_cast<pybind11::ssize_t>(poses.size()));
  auto values = array.mutable_unchecked<1>();
  for (std::size_t i = 0; i < poses.size(); ++i)
    values(static_cast<pybind11::ssize_t>(i)) = poses[i].time_s;
  return array;
}

inline pybind11::array_t<double> CornerArray(const SceneMarker& marker) {
  pybind11::array_t<double> array(std::vector<pybind11::ssize_t>{4, 3});
  auto values = array.mutable_unchecked<2>();
  for (int corner = 0; corner < 4; ++corner)
    for (int axis = 0; axis < 3; ++axis)
      values(corner, axis) = marker.corners[static_cast<std::size_t>(corner)][axis];
  return array;
}

}  // namespace plumb
