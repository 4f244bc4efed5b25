#include "drivers/simulated/tone_curve.hpp"

#include <cmath>

#include "drivers/simulated/random.hpp"

namespace plumb::simulated {
namespace {

// IEC 61966-2-1, in float precision so that images stay the same bit for bit.
float EncodeSrgb(float light) {
  return light <= 0.0031308F ? 12.92F * light : 1.055F * std::pow(light, 1.0F / 2.4F) - 0.055F;
}

}  // namespace

double ToneCurve::Encode(double light) const {
  if (kind == Kind::kLinear) return light;
  if (kind == Kind::kSrgb) return static_cast<double>(EncodeSrgb(static_cast<float>(light)));
  const double root = std::pow(light, 1.0 / gamma);
  if (kind == Kind::kPower) return root;
  return root + contrast * (root * root * (3.0 - 2.0 * root) - root);
}

std::string_view ToString(ToneCurve::Kind kind) {
  switch (kind) {
    case ToneCurve::Kind::kLinear:
      return "linear";
    case ToneCurve::Kind::kPower:
      return "power";
    case ToneCurve::Kind::kSrgb:
      return "sRGB";
    case ToneCurve::Kind::kSShaped:
      return "S-shaped";
  }
  return "unknown";
}

ToneCurve DrawToneCurve(std::uint64_t seed) {
  RandomStream random(seed);
  ToneCurve curve;
  curve.kind = static_cast<ToneCurve::Kind>(static_cast<int>(4.0 * random.Uniform()));
  const double gamma = random.Uniform(1.6, 2.8);
  const double contrast = random.Uniform(0.2, 0.6);
  if (curve.kind == ToneCurve::Kind::kPower) curve.gamma = gamma;
  if (curve.kind == ToneCurve::Kind::kSShaped) curve.contrast = contrast;
  return curve;
}

}  // namespace plumb::simulated
