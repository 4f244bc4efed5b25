// SPDX-License-Identifier: Apache-2.0
// The simulated room (a supporting plane, markers on it, a body, light) and rays through it.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "algo/base/pose.hpp"
#include "algo/types/marker.hpp"
#include "drivers/simulator/world/distance_grid.hpp"
#include "drivers/simulator/world/texture.hpp"

namespace plumb::simulated {

inline constexpr const char* kDictionary = "DICT_6X6_250";
inline constexpr double kMarkerLength =
    kDefaultMarkerLength_m;  ///< Side of the black square, metres.
inline constexpr double kBoardSide =
    0.132;  ///< Side of the white board on which it is printed, metres.

/// A marker of DICT_6X6_250 printed on a stiff white board; the board extends down into the
/// support.
struct Board {
  int id = 0;
  Pose T_world_marker =
      Pose::Identity();  ///< The marker's frame: x right, y up on the print, z out of it.
  /// Side lengths of the printed square over kMarkerLength, along the marker's x and y.
  std::array<double, 2> print_scale = {1.0, 1.0};
  /// The print is a trough or ridge of height bulge_m (1 - (x / half side)^2), so that its corners
  /// are where those of a flat print are.
  double bulge_m = 0.0;
};

/// The true corners of a board's print, world, detector order.
[[nodiscard]] MarkerCorners CornersOf(const Board& board);

/// A thin or long object that is not part of the room, such as a cable or an arm: a rod with round
/// ends.
struct Rod {
  Eigen::Vector3f a = Eigen::Vector3f::Zero();  ///< World, metres.
  Eigen::Vector3f b = Eigen::Vector3f::Zero();
  float radius = 0.01F;
};
/// The rods in view, all of one colour.
struct Rods {
  std::vector<Rod> rods;
  Eigen::Vector3f albedo = Eigen::Vector3f::Constant(0.05F);
};

/// The part of a world that all scenes of a suite share.
struct Room {
  std::vector<Board> boards;
  std::shared_ptr<const Texture> support_texture;
  std::shared_ptr<const Texture> skin_texture;
  /// Couch top in the plane z = 0: everything outside is a floor far below. Without it, z = 0 is
  /// the floor.
  std::optional<Eigen::AlignedBox2f> couch;
  float floor_below_couch_m = 0.75F;
  /// Gloss of the prints: brightness of mirrored lights relative to a white print.
  float gloss = 0.0F;
};

/// The surface hit by a ray, as one number: two rays with different `material` have an edge between
/// them.
using Material = std::uint16_t;
inline constexpr Material kNothing = 0;
inline constexpr Material kSupport = 1;
inline constexpr Material kLowerFloor = 2;
inline constexpr Material kCouchSide = 3;
inline constexpr Material kBody = 4;
inline constexpr Material kRod = 5;
inline constexpr Material kFirstBoard = 8;  ///< Four per board: white, black, side, unused.

/// The object to which a material belongs: all materials of one board are one object.
[[nodiscard]] constexpr Material ObjectOf(Material material) {
  return material < kFirstBoard ? material : static_cast<Material>(material & ~3U);
}
[[nodiscard]] constexpr int BoardOf(Material material) {
  return material < kFirstBoard ? -1 : (material - kFirstBoard) / 4;
}
[[nodiscard]] constexpr bool IsBoardTop(Material material) {
  return material >= kFirstBoard && (material & 3U) < 2;
}

struct Ray {
  Eigen::Vector3f origin;     ///< World, metres.
  Eigen::Vector3f direction;  ///< World, unit length.
};

/// Four rays.
struct Ray4 {
  Vector3x4 origin;     ///< World, metres.
  Vector3x4 direction;  ///< World, unit length.
  Float4 inverse_norm;  ///< For the directions as given: 1 / |direction|.

  Ray4(const Vector3x4& start, const Vector3x4& way)
      : origin(start), inverse_norm(1.0F / Root(SquaredNorm(way))) {
    direction = inverse_norm * way;
  }
};

struct Hit4 {
  Float4 t = Splat(std::numeric_limits<float>::infinity());  ///< Metres along the rays.
  Int4 material{kNothing, kNothing, kNothing, kNothing};
};

struct Hit {
  float t = std::numeric_limits<float>::infinity();  ///< Metres along the ray.
  Material material = kNothing;
};

struct Shading {
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();  ///< World.
  Eigen::Vector3f light =
      Eigen::Vector3f::Zero();  ///< Linear red, green, blue; about 1 on an open horizontal surface.
};

/// Objects that the rays of one small bundle may hit, found once per bundle so that single rays are
/// cheap.
struct Candidates {
  float body_start =
      std::numeric_limits<float>::infinity();  ///< No ray of the bundle hits the body before this.
  std::array<std::uint8_t, 12> boards{};
  int num_boards = 0;
  bool rods = false;  ///< Whether rods may be hit.
};

/// May be read from any number of threads while no thread changes it. Copies are cheap.
class World {
 public:
  /// @param body  Distances of the body in its own frame.
  World(const Room& room, std::shared_ptr<const DistanceGrid> body, const Pose& T_world_body);

  /// @param spread  Radius of the bundle per metre, around `centre`.
  /// @param margin  Radius of its origins, metres.
  [[nodiscard]] Candidates FindCandidates(const Ray& centre, float spread, float margin) const;
  [[nodiscard]] Hit Trace(const Ray& ray, const Candidates& candidates) const;
  /// Four rays at once, at little more than the cost of one.
  [[nodiscard]] Hit4 Trace(const Ray4& rays, const Candidates& candidates) const;

  [[nodiscard]] Eigen::Vector3f Normal(Material material, const Eigen::Vector3f& p_world) const;
  /// Normal and light at a position; both vary slowly over a surface.
  [[nodiscard]] Shading ShadingAt(Material material, const Eigen::Vector3f& p_world) const;
  /// Paint of a surface whose normal is constant over a few pixels.
  struct Paint {
    Material material = kNothing;
    /// Weights of the skin's paint projected along x, y and z of the body; the sum is 1.
    Eigen::Vector3f weight = Eigen::Vector3f::Zero();
  };
  [[nodiscard]] Paint PaintOf(Material material, const Eigen::Vector3f& normal) const;
  /// Fraction of the light that the surface reflects, linear red, green, blue.
  [[nodiscard]] Eigen::Vector3f Albedo(const Paint& paint, const Eigen::Vector3f& p_world) const;
  [[nodiscard]] Eigen::Vector3f MeanAlbedo(const Paint& paint,
                                           /// Mean over four positions.
                                           const Vector3x4& p_world) const;

  /// Light that a board's print mirrors towards `from`: white, in addition to the diffuse light of
  /// its paint.
  [[nodiscard]] float GlareAt(Material material, const Eigen::Vector3f& p_world,
                              const Eigen::Vector3f& from) const;

  /// A board with its print.
  struct BoardPlane {
    Eigen::Matrix3f R_board_world;
    Eigen::Vector3f p_world;
    std::array<std::uint8_t, 64> black;  ///< 8 x 8 cells, row 0 at the top of the print.

    std::array<float, 2> print_half;  ///< Half sides of the print, metres.
    float bulge = 0.0F;

    /// Intersection of rays in the board's frame with its curved top.
    /// @param t  Intersection with its plane.
    [[nodiscard]] Float4 MeetTop(const Vector3x4& origin, const Vector3x4& direction,
                                 Float4 t) const;
    /// In the world frame. @param x  Position on the board.
    [[nodiscard]] Eigen::Vector3f NormalAt(float x) const;
    /// @param x, y  On the board, metres from its centre. @return Mask.
    [[nodiscard]] Int4 IsBlack(Float4 x, Float4 y) const;
  };
  [[nodiscard]] const BoardPlane& PlaneOf(int board) const {
    return boards_[static_cast<std::size_t>(board)];
  }

  // Called between images.
  void MoveBoard(std::size_t board, const Pose& T_world_marker);
  void ChangeBody(std::shared_ptr<const DistanceGrid> body) { body_ = std::move(body); }
  void MoveBody(const Pose& T_world_body);
  void PlaceRods(Rods rods) { rods_ = std::move(rods); }

  [[nodiscard]] const Room& room() const { return room_; }

 private:
  [[nodiscard]] Eigen::Vector3f SupportLight(const Eigen::Vector3f& p_world) const;
  void TraceBoard(int index, const Ray4& rays, Hit4& hits) const;
  void TraceSupport(const Ray4& rays, Hit4& hits) const;
  void TraceCouchSides(const Ray4& rays, Int4 beside, Hit4& hits) const;
  [[nodiscard]] Eigen::Vector3f ToBody(const Eigen::Vector3f& p_world) const {
    return R_body_world_ * p_world + t_body_world_;
  }
  template <typename Place>
  [[nodiscard]] Eigen::Vector3f AlbedoOf(const Paint& paint, const Place& p_world) const;
  void TraceRods(const Ray4& rays, Hit4& hits) const;
  [[nodiscard]] Eigen::Vector3f RodNormal(const Eigen::Vector3f& p_world) const;
  void BakeSupportLight();

  Room room_;
  std::shared_ptr<const DistanceGrid> body_;
  Eigen::Matrix3f R_body_world_;
  Eigen::Vector3f t_body_world_;
  std::vector<BoardPlane> boards_;
  Rods rods_;
  std::vector<float>
      support_light_;  ///< Fraction of the light that reaches the support, on a square grid.
};

}  // namespace plumb::simulated
