// SPDX-License-Identifier: Apache-2.0
// Four numbers at a time, for neighbouring rays. Uses the vector types of g++ and clang: the
// processor's own instructions with the same bits everywhere.
#pragma once

#include <cstdint>
#include <cstring>
#include <limits>

#include <Eigen/Core>

namespace plumb::simulated {

using Float4 = float __attribute__((vector_size(16)));
using Int4 =
    std::int32_t __attribute__((vector_size(16)));  ///< As a mask: -1 where true, 0 where false.

inline constexpr float kInfinity = std::numeric_limits<float>::infinity();

inline Float4 Splat(float a) { return Float4{a, a, a, a}; }
inline Int4 Splat(std::int32_t a) { return Int4{a, a, a, a}; }
inline Float4 Load(const float* four) {
  Float4 a;
  std::memcpy(&a, four, sizeof(a));
  return a;
}
inline Float4 Smaller(Float4 a, Float4 b) { return a < b ? a : b; }
inline Float4 Larger(Float4 a, Float4 b) { return a > b ? a : b; }
inline Float4 Magnitude(Float4 a) { return a < 0.0F ? -a : a; }
inline Float4 Root(Float4 a) {
  Float4 root;
  Eigen::Map<Eigen::Array4f>(reinterpret_cast<float*>(&root)) =
      Eigen::Map<const Eigen::Array4f>(reinterpret_cast<const float*>(&a)).sqrt();
  return root;
}
inline bool Any(Int4 mask) { return (mask[0] | mask[1] | mask[2] | mask[3]) != 0; }

/// A point or direction, or four of them.
template <typename T>
struct Vector3 {
  T x, y, z;
};
using Vector3x4 = Vector3<Float4>;

inline Vector3x4 Splat(const Eigen::Vector3f& v) {
  return {Splat(v.x()), Splat(v.y()), Splat(v.z())};
}
inline Eigen::Vector3f Lane(const Vector3x4& v, int i) { return {v.x[i], v.y[i], v.z[i]}; }
template <typename T>
Vector3<T> operator*(const Eigen::Matrix3f& m, const Vector3<T>& v) {
  return {m(0, 0) * v.x + m(0, 1) * v.y + m(0, 2) * v.z,
          m(1, 0) * v.x + m(1, 1) * v.y + m(1, 2) * v.z,
          m(2, 0) * v.x + m(2, 1) * v.y + m(2, 2) * v.z};
}
inline Vector3x4 operator*(Float4 a, const Vector3x4& v) { return {a * v.x, a * v.y, a * v.z}; }
inline Vector3x4 operator*(Float4 a, const Eigen::Vector3f& v) {
  return {a * v.x(), a * v.y(), a * v.z()};
}
inline Vector3x4 operator+(const Vector3x4& a, const Vector3x4& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline Vector3x4 operator-(const Vector3x4& a, const Eigen::Vector3f& b) {
  return {a.x - b.x(), a.y - b.y(), a.z - b.z()};
}
template <typename T>
Vector3<T> operator+(const Vector3<T>& a, const Eigen::Vector3f& b) {
  return {a.x + b.x(), a.y + b.y(), a.z + b.z()};
}
inline Float4 Dot(const Eigen::Vector3f& a, const Vector3x4& b) {
  return a.x() * b.x + a.y() * b.y + a.z() * b.z;
}
inline Float4 SquaredNorm(const Vector3x4& v) { return v.x * v.x + v.y * v.y + v.z * v.z; }
inline Vector3x4 Cross(const Eigen::Vector3f& a, const Vector3x4& b) {
  return {a.y() * b.z - a.z() * b.y, a.z() * b.x - a.x() * b.z, a.x() * b.y - a.y() * b.x};
}

}  // namespace plumb::simulated
