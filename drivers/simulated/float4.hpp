// Four numbers at a time, for neighbouring rays. The vector types of g++ and clang: each processor's own instructions, the same bits on
// all.
#pragma once

#include <cstdint>

#include <Eigen/Core>

namespace plumb::simulated {

using Float4 = float __attribute__((vector_size(16)));
using Int4 = std::int32_t __attribute__((vector_size(16)));  ///< As a mask: -1 where true, 0 where not.

inline Float4 Splat(float a) { return Float4{a, a, a, a}; }
inline Float4 Smaller(Float4 a, Float4 b) { return a < b ? a : b; }
inline Float4 Larger(Float4 a, Float4 b) { return a > b ? a : b; }
inline bool Any(Int4 mask) { return (mask[0] | mask[1] | mask[2] | mask[3]) != 0; }

/// A point or direction, or four of them.
template <typename T>
struct Vector3 {
  T x, y, z;

  void Set(int i, const Eigen::Vector3f& v) {
    x[i] = v.x();
    y[i] = v.y();
    z[i] = v.z();
  }
};
using Vector3x4 = Vector3<Float4>;

inline Vector3x4 Splat(const Eigen::Vector3f& v) { return {Splat(v.x()), Splat(v.y()), Splat(v.z())}; }
template <typename T>
Vector3<T> operator*(const Eigen::Matrix3f& m, const Vector3<T>& v) {
  return {m(0, 0) * v.x + m(0, 1) * v.y + m(0, 2) * v.z, m(1, 0) * v.x + m(1, 1) * v.y + m(1, 2) * v.z,
          m(2, 0) * v.x + m(2, 1) * v.y + m(2, 2) * v.z};
}
template <typename T>
Vector3<T> operator+(const Vector3<T>& a, const Eigen::Vector3f& b) {
  return {a.x + b.x(), a.y + b.y(), a.z + b.z()};
}

}  // namespace plumb::simulated
