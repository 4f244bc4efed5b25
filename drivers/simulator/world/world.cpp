// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/world/world.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <tbb/parallel_for.h>

#include "algo/types/marker_dictionary.hpp"

namespace plumb::simulated {
namespace {

using Eigen::Vector3f;

constexpr float kBoardHalf = static_cast<float>(kBoardSide / 2);
constexpr float kMarkerHalf = static_cast<float>(kMarkerLength / 2);
constexpr float kBoardDepth = 0.12F;  // Below the surface of the support.
constexpr float kCouchThickness = 0.08F;

// Two ceiling panels.
const std::array<Vector3f, 2> kPanels = {Vector3f(-0.7F, 0.9F, 2.3F), Vector3f(0.8F, -0.8F, 2.4F)};
constexpr float kPanelStrength = 0.62F;
constexpr float kAmbient = 0.55F;
const Vector3f kLightColor(1.0F, 0.97F, 0.92F);

constexpr float kLightGridLow = -1.6F;
constexpr float kLightGridStep = 0.025F;
constexpr int kLightGridSize = 129;

float PanelLight(const Vector3f& p, const Vector3f& normal, std::size_t panel) {
  const Vector3f to_panel = kPanels[panel] - p;
  const float distance = to_panel.norm();
  return std::max(0.0F, normal.dot(to_panel) / distance) *
         std::min(1.3F, 5.0F / (distance * distance));
}

std::array<std::uint8_t, 64> BlackCells(const MarkerDictionary& dictionary, int id) {
  std::array<std::uint8_t, 64> black{};
  for (int row = 0; row < 8; ++row) {
    for (int column = 0; column < 8; ++column) {
      const bool border = row == 0 || column == 0 || row == 7 || column == 7;
      black[static_cast<std::size_t>(8 * row + column)] =
          border || !dictionary.Bit(id, row - 1, column - 1) ? 1 : 0;
    }
  }
  return black;
}

}  // namespace

MarkerCorners CornersOf(const Board& board) {
  MarkerCorners corners = CornersInMarkerFrame(kMarkerLength);
  for (Eigen::Vector3d& corner : corners)
    corner = board.T_world_marker * Eigen::Vector3d(board.print_scale[0] * corner.x(),
                                                    board.print_scale[1] * corner.y(), 0.0);
  return corners;
}

World::World(const Room& room, std::shared_ptr<const DistanceGrid> body, const Pose& T_world_body)
    : room_(room), body_(std::move(body)) {
  if (!body_ || !room_.support_texture || !room_.skin_texture)
    throw std::invalid_argument("world needs a body and its textures");
  if (room_.boards.size() > 250)
    throw std::invalid_argument("world: more boards than the dictionary has markers");
  MoveBody(T_world_body);
  const MarkerDictionary dictionary = MarkerDictionary::ByName(kDictionary);
  for (const Board& board : room_.boards) {
    boards_.push_back({board.T_world_marker.linear().transpose().cast<float>(),
                       board.T_world_marker.translation().cast<float>(),
                       BlackCells(dictionary, board.id),
                       {static_cast<float>(board.print_scale[0]) * kMarkerHalf,
                        static_cast<float>(board.print_scale[1]) * kMarkerHalf},
                       static_cast<float>(board.bulge_m)});
  }
  BakeSupportLight();
}

void World::MoveBody(const Pose& T_world_body) {
  const Pose T_body_world = T_world_body.inverse();
  R_body_world_ = T_body_world.linear().cast<float>();
  t_body_world_ = T_body_world.translation().cast<float>();
}

void World::MoveBoard(std::size_t board, const Pose& T_world_marker) {
  room_.boards.at(board).T_world_marker = T_world_marker;
  boards_[board].R_board_world = T_world_marker.linear().transpose().cast<float>();
  boards_[board].p_world = T_world_marker.translation().cast<float>();
}

void World::BakeSupportLight() {
  support_light_.resize(static_cast<std::size_t>(kLightGridSize) * kLightGridSize);
  tbb::parallel_for(0, kLightGridSize, [&](int row) {
    for (int column = 0; column < kLightGridSize; ++column) {
      const Vector3f p(kLightGridLow + static_cast<float>(column) * kLightGridStep,
                       kLightGridLow + static_cast<float>(row) * kLightGridStep, 0.002F);
      const auto blocked = [&](const Vector3f& target) {
        const Vector3f way = target - p;
        const float length = way.norm();
        return std::isfinite(
            body_->Intersect(ToBody(p), R_body_world_ * way / length, 0.0F, length));
      };
      // Cosine-weighted directions on a fixed spiral, the same for every cell, so that the light
      // varies smoothly.
      constexpr int kDirections = 24;
      int open = 0;
      for (int i = 0; i < kDirections; ++i) {
        const float radius = std::sqrt((static_cast<float>(i) + 0.5F) / kDirections);
        const float angle = 2.399963F * static_cast<float>(i);
        open += blocked(p + Vector3f(radius * std::cos(angle), radius * std::sin(angle),
                                     std::sqrt(1.0F - radius * radius)))
                    ? 0
                    : 1;
      }
      float light = kAmbient * static_cast<float>(open) / kDirections;
      for (std::size_t panel = 0; panel < kPanels.size(); ++panel) {
        int visible = 0;
        for (int i = 0; i < 9; ++i) {
          const Vector3f offset(0.35F * static_cast<float>(i % 3 - 1),
                                0.35F * static_cast<float>(i / 3 - 1), 0.0F);
          visible += blocked(kPanels[panel] + offset) ? 0 : 1;
        }
        light += kPanelStrength * PanelLight(p, Vector3f::UnitZ(), panel) *
                 static_cast<float>(visible) / 9.0F;
      }
      support_light_[static_cast<std::size_t>(row) * kLightGridSize +
                     static_cast<std::size_t>(column)] = light;
    }
  });
}

Candidates World::FindCandidates(const Ray& centre, float spread, float margin) const {
  Candidates found;
  for (std::size_t i = 0; i < boards_.size(); ++i) {
    // Sphere around the top of the board and the part of its side above the support.
    const Vector3f to_board = boards_[i].p_world - centre.origin;
    const float along = to_board.dot(centre.direction);
    const float beside = (to_board - along * centre.direction).norm();
    if (along > 0 && beside < kBoardHalf * 1.6F + margin + spread * (along + 0.1F) &&
        found.num_boards < static_cast<int>(found.boards.size())) {
      found.boards[static_cast<std::size_t>(found.num_boards++)] = static_cast<std::uint8_t>(i);
    }
  }
  for (const Rod& rod : rods_.rods) {
    const Vector3f to_rod = 0.5F * (rod.a + rod.b) - centre.origin;
    const float along = to_rod.dot(centre.direction);
    const float beside = (to_rod - along * centre.direction).norm();
    const float reach = 0.5F * (rod.b - rod.a).norm() + rod.radius;
    found.rods =
        found.rods || (along > -reach && beside < reach + margin + spread * (along + reach));
  }
  constexpr float kFurthest = 6.0F;
  found.body_start = body_->ConeStart(ToBody(centre.origin), R_body_world_ * centre.direction,
                                      spread, margin, kFurthest);
  return found;
}

void World::TraceSupport(const Ray4& rays, Hit4& hits) const {
  const Int4 down = rays.direction.z < -1e-4F;
  const Float4 t = -rays.origin.z / rays.direction.z;
  hits.t = down ? t : hits.t;
  hits.material = down ? Splat(std::int32_t{kSupport}) : hits.material;
  if (!room_.couch) return;
  const Float4 x = rays.origin.x + t * rays.direction.x;
  const Float4 y = rays.origin.y + t * rays.direction.y;
  const Eigen::Vector2f &low = room_.couch->min(), &high = room_.couch->max();
  const Int4 beside = down & ~((x >= low.x()) & (x <= high.x()) & (y >= low.y()) & (y <= high.y()));
  if (Any(beside)) TraceCouchSides(rays, beside, hits);
}

// For rays that pass beside the couch top: the floor, or a vertical side of the couch seen from
// outside.
void World::TraceCouchSides(const Ray4& rays, Int4 beside, Hit4& hits) const {
  hits.t = beside ? hits.t - room_.floor_below_couch_m / rays.direction.z : hits.t;
  hits.material = beside ? Splat(std::int32_t{kLowerFloor}) : hits.material;
  const Eigen::Vector2f &low = room_.couch->min(), &high = room_.couch->max();
  const auto side = [&](Float4 origin, Float4 direction, float near, float far, Float4 other_origin,
                        Float4 other_direction, float left, float right) {
    const Float4 t = ((direction > 0.0F ? Splat(near) : Splat(far)) - origin) / direction;
    const Float4 z = rays.origin.z + t * rays.direction.z;
    const Float4 other = other_origin + t * other_direction;
    const Int4 met = beside & (Magnitude(direction) >= 1e-6F) & (t > 0.0F) & (z < 0.0F) &
                     (z > -kCouchThickness) & (other >= left) & (other <= right);
    hits.t = met ? t : hits.t;
    hits.material = met ? Splat(std::int32_t{kCouchSide}) : hits.material;
  };
  side(rays.origin.x, rays.direction.x, low.x(), high.x(), rays.origin.y, rays.direction.y, low.y(),
       high.y());
  side(rays.origin.y, rays.direction.y, low.y(), high.y(), rays.origin.x, rays.direction.x, low.x(),
       high.x());
}

void World::TraceBoard(int index, const Ray4& rays, Hit4& hits) const {
  const BoardPlane& board = boards_[static_cast<std::size_t>(index)];
  const Vector3x4 o = board.R_board_world * (rays.origin - board.p_world);
  const Vector3x4 d = board.R_board_world * rays.direction;
  Float4 t_near = Splat(0.0F);
  Float4 t_far = hits.t;
  const auto clip = [&](Float4 origin, Float4 direction, float low, float high) {
    const Float4 inverse = 1.0F / direction;
    const Float4 a = (low - origin) * inverse;
    const Float4 b = (high - origin) * inverse;
    t_far = Smaller(Larger(a, b), t_far);
    return Smaller(a, b);
  };
  t_near = Larger(t_near, clip(o.x, d.x, -kBoardHalf, kBoardHalf));
  t_near = Larger(t_near, clip(o.y, d.y, -kBoardHalf, kBoardHalf));
  const Float4 top = clip(o.z, d.z, -kBoardDepth, 0.0F);
  const Int4 through_top = top > t_near;
  t_near = Larger(t_near, top);
  if (board.bulge != 0.0F) t_near = through_top ? board.MeetTop(o, d, t_near) : t_near;
  const Int4 met = (t_near < t_far) & (t_near > 0.0F);
  if (!Any(met)) return;
  hits.t = met ? t_near : hits.t;
  const Int4 part =
      through_top ? board.IsBlack(o.x + t_near * d.x, o.y + t_near * d.y) & 1 : Splat(2);
  hits.material = met ? kFirstBoard + 4 * index + part : hits.material;
}

Float4 World::BoardPlane::MeetTop(const Vector3x4& origin, const Vector3x4& direction,
                                  Float4 t) const {
  // The slope is below 1/8, so each iteration leaves less than a fifth of the error.
  const float inverse_half = 1.0F / print_half[0];
  for (int i = 0; i < 4; ++i) {
    const Float4 x = (origin.x + t * direction.x) * inverse_half;
    t = (bulge * (1.0F - x * x) - origin.z) / direction.z;
  }
  return t;
}

Vector3f World::BoardPlane::NormalAt(float x) const {
  if (bulge == 0.0F) return R_board_world.row(2);
  const float slope = -2.0F * bulge * x / (print_half[0] * print_half[0]);
  return R_board_world.transpose() * Vector3f(-slope, 0.0F, 1.0F).normalized();
}

Int4 World::BoardPlane::IsBlack(Float4 x, Float4 y) const {
  const Float4 column = (x + print_half[0]) * (4.0F / print_half[0]);
  const Float4 row = (print_half[1] - y) * (4.0F / print_half[1]);
  const Int4 printed = (column >= 0.0F) & (row >= 0.0F) & (column < 8.0F) & (row < 8.0F);
  const Int4 cell =
      printed ? 8 * __builtin_convertvector(row, Int4) + __builtin_convertvector(column, Int4)
              : Splat(0);
  const auto at = [&](int i) {
    return static_cast<std::int32_t>(black[static_cast<std::size_t>(cell[i])]);
  };
  return printed & (Int4{at(0), at(1), at(2), at(3)} != 0);
}

Hit4 World::Trace(const Ray4& rays, const Candidates& candidates) const {
  Hit4 hits;
  TraceSupport(rays, hits);
  for (int i = 0; i < candidates.num_boards; ++i)
    TraceBoard(candidates.boards[static_cast<std::size_t>(i)], rays, hits);
  if (candidates.rods) TraceRods(rays, hits);
  const Float4 begin = Splat(candidates.body_start);
  if (!Any(begin < hits.t)) return hits;
  const Float4 t = body_->Intersect(R_body_world_ * rays.origin + t_body_world_,
                                    R_body_world_ * rays.direction, begin, hits.t);
  const Int4 met = t < hits.t;
  hits.t = met ? t : hits.t;
  hits.material = met ? Splat(std::int32_t{kBody}) : hits.material;
  return hits;
}

Hit World::Trace(const Ray& ray, const Candidates& candidates) const {
  const Hit4 hits = Trace(Ray4(Splat(ray.origin), Splat(ray.direction)), candidates);
  return {hits.t[0], static_cast<Material>(hits.material[0])};
}

Vector3f World::Normal(Material material, const Vector3f& p_world) const {
  if (material == kBody) return R_body_world_.transpose() * body_->Normal(ToBody(p_world));
  if (material == kRod) return RodNormal(p_world);
  if (IsBoardTop(material)) {
    const BoardPlane& board = PlaneOf(BoardOf(material));
    return board.NormalAt(board.R_board_world.row(0).dot(p_world - board.p_world));
  }
  return Vector3f::UnitZ();
}

// The first rod hit by each ray, if it is nearer than the previous hit.
void World::TraceRods(const Ray4& rays, Hit4& hits) const {
  for (const Rod& rod : rods_.rods) {
    const Vector3f axis = rod.b - rod.a;
    const float axis_squared = axis.squaredNorm();
    const Vector3x4 from = rays.origin - rod.a;
    const Float4 across = Dot(axis, rays.direction);
    const Float4 from_axis = Dot(axis, from);
    const Float4 from_direction =
        from.x * rays.direction.x + from.y * rays.direction.y + from.z * rays.direction.z;
    const Float4 radius_squared = Splat(rod.radius * rod.radius);
    // The cylinder: both sides are multiplied by the square of the axis.
    const Float4 a = axis_squared - across * across;
    const Float4 b = axis_squared * from_direction - from_axis * across;
    const Float4 c = axis_squared * (SquaredNorm(from) - radius_squared) - from_axis * from_axis;
    const Float4 rest = b * b - a * c;
    const Float4 t_side = (-b - Root(Larger(rest, Splat(0.0F)))) / Larger(a, Splat(1e-9F));
    const Float4 along = from_axis + t_side * across;
    const Int4 on_side = (rest > 0.0F) & (along > 0.0F) & (along < axis_squared);
    // The nearer ball at its end.
    const Int4 beyond = along >= axis_squared;
    const Vector3x4 from_b = rays.origin - rod.b;
    const Float4 to_ball = beyond ? from_b.x * rays.direction.x + from_b.y * rays.direction.y +
                                        from_b.z * rays.direction.z
                                  : from_direction;
    const Float4 ball_rest =
        to_ball * to_ball - (beyond ? SquaredNorm(from_b) : SquaredNorm(from)) + radius_squared;
    const Float4 t_ball = -to_ball - Root(Larger(ball_rest, Splat(0.0F)));
    const Float4 t = on_side ? t_side : t_ball;
    const Int4 met = (on_side | (ball_rest > 0.0F)) & (t > 0.0F) & (t < hits.t);
    hits.t = met ? t : hits.t;
    hits.material = met ? Splat(std::int32_t{kRod}) : hits.material;
  }
}

Vector3f World::RodNormal(const Vector3f& p_world) const {
  Vector3f best = Vector3f::UnitZ();
  float nearest = std::numeric_limits<float>::infinity();
  for (const Rod& rod : rods_.rods) {
    const Vector3f axis = rod.b - rod.a;
    const float along = std::clamp((p_world - rod.a).dot(axis) / axis.squaredNorm(), 0.0F, 1.0F);
    const Vector3f away = p_world - rod.a - along * axis;
    const float distance = std::abs(away.norm() - rod.radius);
    if (distance >= nearest) continue;
    nearest = distance;
    best = away.normalized();
  }
  return best;
}

float World::GlareAt(Material material, const Vector3f& p_world, const Vector3f& from) const {
  if (room_.gloss <= 0.0F || !IsBoardTop(material)) return 0.0F;
  constexpr float kWidth =
      0.12F;  // Radians: half of a panel's own size, plus a coating that is not quite flat.
  const Vector3f normal = Normal(material, p_world);
  const Vector3f view = (p_world - from).normalized();
  const Vector3f mirrored = view - 2.0F * view.dot(normal) * normal;
  float glare = 0.0F;
  for (const Vector3f& panel : kPanels) {
    const float off = ((panel - p_world).normalized() - mirrored).squaredNorm();
    glare += std::exp(-off / (2.0F * kWidth * kWidth));
  }
  return room_.gloss * glare;
}

World::Paint World::PaintOf(Material material, const Vector3f& normal) const {
  if (material != kBody) return {material};
  // The paint is projected along the three axes and blended by how directly each one faces the
  // skin.
  const Vector3f n = (R_body_world_ * normal).cwiseAbs2();
  Vector3f weight = n.cwiseProduct(n);
  weight = (weight.array() > 0.03F * weight.sum()).select(weight, 0.0F);
  return {material, weight / weight.sum()};
}

template <typename Place>
Vector3f World::AlbedoOf(const Paint& paint, const Place& p_world) const {
  const Material material = paint.material;
  if (material == kSupport) return room_.support_texture->At(p_world.x, p_world.y);
  if (material == kBody) {
    const Place p = R_body_world_ * p_world + t_body_world_;
    const Texture& skin = *room_.skin_texture;
    Vector3f albedo = Vector3f::Zero();
    if (paint.weight.z() > 0) albedo += paint.weight.z() * skin.At(p.x, p.y);
    if (paint.weight.y() > 0) albedo += paint.weight.y() * skin.At(p.x + 0.37F, p.z + 0.21F);
    if (paint.weight.x() > 0) albedo += paint.weight.x() * skin.At(p.y + 0.11F, p.z - 0.33F);
    return albedo;
  }
  if (material == kRod) return rods_.albedo;
  if (material == kLowerFloor)
    return 0.6F * room_.support_texture->At(p_world.y * 0.8F, p_world.x * 0.8F);
  if (material == kCouchSide) return Vector3f(0.25F, 0.26F, 0.28F);
  if (material < kFirstBoard) return Vector3f::Constant(0.02F);
  const int part = (material - kFirstBoard) % 4;
  if (part == 0) return Vector3f(0.78F, 0.78F, 0.76F);
  return part == 1 ? Vector3f::Constant(0.045F) : Vector3f(0.45F, 0.43F, 0.40F);
}

Vector3f World::Albedo(const Paint& paint, const Vector3f& p_world) const {
  return AlbedoOf(paint, Vector3<float>{p_world.x(), p_world.y(), p_world.z()});
}
Vector3f World::MeanAlbedo(const Paint& paint, const Vector3x4& p_world) const {
  return AlbedoOf(paint, p_world);
}

Vector3f World::SupportLight(const Vector3f& p_world) const {
  const float gx =
      std::clamp((p_world.x() - kLightGridLow) / kLightGridStep, 0.0F, kLightGridSize - 1.001F);
  const float gy =
      std::clamp((p_world.y() - kLightGridLow) / kLightGridStep, 0.0F, kLightGridSize - 1.001F);
  const int x = static_cast<int>(gx);
  const int y = static_cast<int>(gy);
  const float* light =
      &support_light_[static_cast<std::size_t>(y) * kLightGridSize + static_cast<std::size_t>(x)];
  const float u = gx - static_cast<float>(x);
  const float near = light[0] + u * (light[1] - light[0]);
  const float far = light[kLightGridSize] + u * (light[kLightGridSize + 1] - light[kLightGridSize]);
  return kLightColor * (near + (gy - static_cast<float>(y)) * (far - near));
}

Shading World::ShadingAt(Material material, const Vector3f& p_world) const {
  if (material == kLowerFloor || material == kCouchSide || material == kNothing)
    return {Vector3f::UnitZ(), 0.6F * kLightColor};
  if (material == kRod) {
    const Vector3f normal = RodNormal(p_world);
    float light = kAmbient * (0.5F + 0.5F * normal.z());
    for (std::size_t panel = 0; panel < kPanels.size(); ++panel)
      light += kPanelStrength * PanelLight(p_world, normal, panel);
    return {normal, kLightColor * light};
  }
  if (material != kBody) return {Normal(material, p_world), SupportLight(p_world)};
  const Eigen::Vector4f shade = body_->Shade(ToBody(p_world));
  const Vector3f normal = R_body_world_.transpose() * shade.head<3>();
  // The support darkens what is close above it and is not itself shaded from below.
  const float above = std::clamp(p_world.z() / 0.12F, 0.0F, 1.0F);
  const float open = shade.w() * (0.45F + 0.55F * std::max(above, normal.z()));
  float light = kAmbient * (0.5F + 0.5F * normal.z()) * open;
  for (std::size_t panel = 0; panel < kPanels.size(); ++panel)
    light += kPanelStrength * PanelLight(p_world, normal, panel) * (0.4F + 0.6F * open);
  return {normal, kLightColor * light};
}

}  // namespace plumb::simulated
