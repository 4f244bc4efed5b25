#include "drivers/simulated/world.hpp"

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
constexpr float kBoardDepth = 0.12F;  // Into the support.
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
  return std::max(0.0F, normal.dot(to_panel) / distance) * std::min(1.3F, 5.0F / (distance * distance));
}

std::array<std::uint8_t, 64> BlackCells(const MarkerDictionary& dictionary, int id) {
  std::array<std::uint8_t, 64> black{};
  for (int row = 0; row < 8; ++row) {
    for (int column = 0; column < 8; ++column) {
      const bool border = row == 0 || column == 0 || row == 7 || column == 7;
      black[static_cast<std::size_t>(8 * row + column)] = border || !dictionary.Bit(id, row - 1, column - 1) ? 1 : 0;
    }
  }
  return black;
}

}  // namespace

World::World(const Room& room, std::shared_ptr<const DistanceGrid> body, const Pose& T_world_body)
    : room_(room), body_(std::move(body)), T_world_body_(T_world_body) {
  if (!body_ || !room_.support_texture || !room_.skin_texture) throw std::invalid_argument("world needs a body and its textures");
  if (room_.boards.size() > 250) throw std::invalid_argument("world: more boards than the dictionary has markers");
  const Pose T_body_world = T_world_body.inverse();
  R_body_world_ = T_body_world.linear().cast<float>();
  t_body_world_ = T_body_world.translation().cast<float>();
  const MarkerDictionary dictionary = MarkerDictionary::ByName(kDictionary);
  for (const Board& board : room_.boards) {
    boards_.push_back({board.T_world_marker.linear().transpose().cast<float>(), board.T_world_marker.translation().cast<float>(),
                       BlackCells(dictionary, board.id)});
  }
  BakeSupportLight();
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
        return std::isfinite(body_->Intersect(ToBody(p), R_body_world_ * way / length, 0.0F, length));
      };
      // Cosine-weighted directions on a fixed spiral: the same for every cell, so the light varies smoothly.
      constexpr int kDirections = 24;
      int open = 0;
      for (int i = 0; i < kDirections; ++i) {
        const float radius = std::sqrt((static_cast<float>(i) + 0.5F) / kDirections);
        const float angle = 2.399963F * static_cast<float>(i);
        open += blocked(p + Vector3f(radius * std::cos(angle), radius * std::sin(angle), std::sqrt(1.0F - radius * radius))) ? 0 : 1;
      }
      float light = kAmbient * static_cast<float>(open) / kDirections;
      for (std::size_t panel = 0; panel < kPanels.size(); ++panel) {
        int visible = 0;
        for (int i = 0; i < 9; ++i) {
          const Vector3f offset(0.35F * static_cast<float>(i % 3 - 1), 0.35F * static_cast<float>(i / 3 - 1), 0.0F);
          visible += blocked(kPanels[panel] + offset) ? 0 : 1;
        }
        light += kPanelStrength * PanelLight(p, Vector3f::UnitZ(), panel) * static_cast<float>(visible) / 9.0F;
      }
      support_light_[static_cast<std::size_t>(row) * kLightGridSize + static_cast<std::size_t>(column)] = light;
    }
  });
}

Candidates World::FindCandidates(const Ray& centre, float spread, float margin) const {
  Candidates found;
  for (std::size_t i = 0; i < boards_.size(); ++i) {
    // Sphere around the board's top and the part of its side above the support.
    const Vector3f to_board = boards_[i].p_world - centre.origin;
    const float along = to_board.dot(centre.direction);
    const float beside = (to_board - along * centre.direction).norm();
    if (along > 0 && beside < kBoardHalf * 1.6F + margin + spread * (along + 0.1F) &&
        found.num_boards < static_cast<int>(found.boards.size())) {
      found.boards[static_cast<std::size_t>(found.num_boards++)] = static_cast<std::uint8_t>(i);
    }
  }
  constexpr float kFurthest = 6.0F;
  found.body_start = body_->ConeStart(ToBody(centre.origin), R_body_world_ * centre.direction, spread, margin, kFurthest);
  return found;
}

void World::TraceSupport(const Ray& ray, Hit& hit) const {
  if (ray.direction.z() > -1e-4F) return;
  const float t = -ray.origin.z() / ray.direction.z();
  const Vector3f p = ray.origin + t * ray.direction;
  if (!room_.couch || room_.couch->contains(Eigen::Vector2f(p.head<2>()))) {
    hit = {t, kSupport};
    return;
  }
  hit = {t - room_.floor_below_couch_m / ray.direction.z(), kLowerFloor};
  // The couch's vertical sides, seen from outside.
  for (int axis = 0; axis < 2; ++axis) {
    if (std::abs(ray.direction[axis]) < 1e-6F) continue;
    const float plane = ray.direction[axis] > 0 ? room_.couch->min()[axis] : room_.couch->max()[axis];
    const float t_side = (plane - ray.origin[axis]) / ray.direction[axis];
    const Vector3f q = ray.origin + t_side * ray.direction;
    const int other = 1 - axis;
    if (t_side > 0 && q.z() < 0 && q.z() > -kCouchThickness && q[other] >= room_.couch->min()[other] &&
        q[other] <= room_.couch->max()[other]) {
      hit = {t_side, kCouchSide};
    }
  }
}

void World::TraceBoard(int index, const Ray& ray, Hit& hit) const {
  const BoardPlane& board = boards_[static_cast<std::size_t>(index)];
  const Vector3f o = board.R_board_world * (ray.origin - board.p_world);
  const Vector3f d = board.R_board_world * ray.direction;
  float t_near = 0;
  float t_far = hit.t;
  bool through_top = false;
  for (int axis = 0; axis < 3; ++axis) {
    const float inverse = 1.0F / d[axis];
    float near = ((axis < 2 ? -kBoardHalf : -kBoardDepth) - o[axis]) * inverse;
    float far = ((axis < 2 ? kBoardHalf : 0.0F) - o[axis]) * inverse;
    if (near > far) std::swap(near, far);
    if (near > t_near) {
      t_near = near;
      through_top = axis == 2;
    }
    t_far = std::min(t_far, far);
  }
  if (t_near >= t_far || t_near <= 0) return;
  hit.t = t_near;
  const int part = !through_top ? 2 : board.IsBlack(o.x() + t_near * d.x(), o.y() + t_near * d.y()) ? 1 : 0;
  hit.material = static_cast<Material>(kFirstBoard + 4 * index + part);
}

bool World::BoardPlane::IsBlack(float x, float y) const {
  constexpr float kCellsPerMetre = 8.0F / (2.0F * kMarkerHalf);
  const float column = (x + kMarkerHalf) * kCellsPerMetre;
  const float row = (kMarkerHalf - y) * kCellsPerMetre;
  const bool printed = column >= 0 && row >= 0 && column < 8 && row < 8;
  return printed && black[static_cast<std::size_t>(8 * static_cast<int>(row) + static_cast<int>(column))] != 0;
}

Hit World::TraceFlat(const Ray& ray, const Candidates& candidates) const {
  Hit hit;
  TraceSupport(ray, hit);
  for (int i = 0; i < candidates.num_boards; ++i) TraceBoard(candidates.boards[static_cast<std::size_t>(i)], ray, hit);
  return hit;
}

Hit World::Trace(const Ray& ray, const Candidates& candidates) const {
  Hit hit = TraceFlat(ray, candidates);
  if (candidates.body_start < hit.t) {
    const float t = body_->Intersect(ToBody(ray.origin), R_body_world_ * ray.direction, candidates.body_start, hit.t);
    if (t < hit.t) hit = {t, kBody};
  }
  return hit;
}

std::array<Hit, 4> World::Trace(const std::array<Ray, 4>& rays, const Candidates& candidates) const {
  std::array<Hit, 4> hits;
  Vector3x4 origin;
  Vector3x4 direction;
  Float4 end;
  for (std::size_t i = 0; i < 4; ++i) {
    hits[i] = TraceFlat(rays[i], candidates);
    const int lane = static_cast<int>(i);
    origin.Set(lane, rays[i].origin);
    direction.Set(lane, rays[i].direction);
    end[lane] = hits[i].t;
  }
  const Float4 begin = Splat(candidates.body_start);
  if (!Any(begin < end)) return hits;
  const Float4 t = body_->Intersect(R_body_world_ * origin + t_body_world_, R_body_world_ * direction, begin, end);
  for (std::size_t i = 0; i < 4; ++i) {
    if (t[static_cast<int>(i)] < hits[i].t) hits[i] = {t[static_cast<int>(i)], kBody};
  }
  return hits;
}

Vector3f World::Normal(Material material, const Vector3f& p_world) const {
  if (material == kBody) return R_body_world_.transpose() * body_->Normal(ToBody(p_world));
  if (IsBoardTop(material)) return boards_[static_cast<std::size_t>(BoardOf(material))].R_board_world.row(2);
  return Vector3f::UnitZ();
}

World::Paint World::PaintOf(Material material, const Vector3f& normal) const {
  if (material != kBody) return {material};
  // The paint is projected along the three axes and blended by how squarely each one meets the skin.
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
  if (material == kLowerFloor) return 0.6F * room_.support_texture->At(p_world.y * 0.8F, p_world.x * 0.8F);
  if (material == kCouchSide) return Vector3f(0.25F, 0.26F, 0.28F);
  if (material < kFirstBoard) return Vector3f::Constant(0.02F);
  const int part = (material - kFirstBoard) % 4;
  if (part == 0) return Vector3f(0.78F, 0.78F, 0.76F);
  return part == 1 ? Vector3f::Constant(0.045F) : Vector3f(0.45F, 0.43F, 0.40F);
}

Vector3f World::Albedo(const Paint& paint, const Vector3f& p_world) const {
  return AlbedoOf(paint, Vector3<float>{p_world.x(), p_world.y(), p_world.z()});
}
Vector3f World::MeanAlbedo(const Paint& paint, const Vector3x4& p_world) const { return AlbedoOf(paint, p_world); }

Vector3f World::SupportLight(const Vector3f& p_world) const {
  const float gx = std::clamp((p_world.x() - kLightGridLow) / kLightGridStep, 0.0F, kLightGridSize - 1.001F);
  const float gy = std::clamp((p_world.y() - kLightGridLow) / kLightGridStep, 0.0F, kLightGridSize - 1.001F);
  const int x = static_cast<int>(gx);
  const int y = static_cast<int>(gy);
  const float* light = &support_light_[static_cast<std::size_t>(y) * kLightGridSize + static_cast<std::size_t>(x)];
  const float u = gx - static_cast<float>(x);
  const float near = light[0] + u * (light[1] - light[0]);
  const float far = light[kLightGridSize] + u * (light[kLightGridSize + 1] - light[kLightGridSize]);
  return kLightColor * (near + (gy - static_cast<float>(y)) * (far - near));
}

Shading World::ShadingAt(Material material, const Vector3f& p_world) const {
  if (material == kLowerFloor || material == kCouchSide || material == kNothing) return {Vector3f::UnitZ(), 0.6F * kLightColor};
  if (material != kBody) return {Normal(material, p_world), SupportLight(p_world)};
  const Eigen::Vector4f shade = body_->Shade(ToBody(p_world));
  const Vector3f normal = R_body_world_.transpose() * shade.head<3>();
  // The support darkens what is close above it and does not look up.
  const float above = std::clamp(p_world.z() / 0.12F, 0.0F, 1.0F);
  const float open = shade.w() * (0.45F + 0.55F * std::max(above, normal.z()));
  float light = kAmbient * (0.5F + 0.5F * normal.z()) * open;
  for (std::size_t panel = 0; panel < kPanels.size(); ++panel)
    light += kPanelStrength * PanelLight(p_world, normal, panel) * (0.4F + 0.6F * open);
  return {normal, kLightColor * light};
}

}  // namespace plumb::simulated
