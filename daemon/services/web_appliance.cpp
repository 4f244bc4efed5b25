// SPDX-License-Identifier: Apache-2.0
// The page's service for the state of the appliance and its button.
#include "daemon/services/web_services.hpp"

#include <cstdint>
#include <utility>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "daemon/files/compact_map.hpp"
#include "daemon/monitoring/outline_watch.hpp"
#include "drivers/files/image_file.hpp"
#include "web/model/limits.hpp"

namespace plumb {

namespace {

constexpr auto kPreviewEvery = std::chrono::milliseconds(200);
constexpr int kPhotoColumns = 1280;

/// With less quality where it would be too large.
std::string PhotoJpeg(const cv::Mat& color_rgb) {
  cv::Mat picture = color_rgb;
  if (picture.cols > kPhotoColumns)
    cv::resize(color_rgb, picture, {kPhotoColumns, color_rgb.rows * kPhotoColumns / color_rgb.cols},
               0, 0, cv::INTER_AREA);
  std::vector<std::uint8_t> jpeg;
  for (const int quality : {85, 70, 50, 30}) {
    jpeg = EncodeJpeg(picture, quality);
    if (jpeg.size() <= kMaxPhoto) break;
  }
  return {jpeg.begin(), jpeg.end()};
}

class WebAppliance final : public web::ApplianceService {
 public:
  WebAppliance(Appliance& appliance, const SensorThread& sensors, OutlineWatch& outline,
               Notices& notices)
      : appliance_(appliance), sensors_(sensors), outline_(outline), notices_(notices) {}

  Status GetStatus() override { return appliance_.WebStatus(); }

  Health GetHealth() override { return appliance_.health(); }

  std::shared_ptr<const std::string> Preview() override {
    const auto now = std::chrono::steady_clock::now();
    const std::optional<Frame> frame = sensors_.latest();
    if (!frame) {
      preview_.reset();
      return nullptr;
    }
    if (preview_ && (now - preview_at_ < kPreviewEvery || frame->index == preview_index_))
      return preview_;
    preview_ = std::make_shared<const std::string>(PreviewJpeg(frame->color_rgb));
    preview_at_ = now;
    preview_index_ = frame->index;
    return preview_;
  }

  std::function<std::string()> Photographer() override {
    const std::optional<Frame> frame = sensors_.latest();
    if (!frame) return {};
    return [picture = frame->color_rgb] { return PhotoJpeg(picture); };
  }

  std::optional<CameraOutline> Outline() override {
    const auto picture = outline_.Newest();
    if (!picture) return std::nullopt;
    CameraOutline outline{.jpeg = picture->jpeg,
                          .reference = picture->reference,
                          .lines = {},
                          .is_placed = picture->is_placed};
    for (const auto& line : picture->lines) {
      auto& points = outline.lines.emplace_back();
      for (const Eigen::Vector2f& p : line) points.emplace_back(p.x(), p.y());
    }
    return outline;
  }

  std::shared_ptr<const std::string> SweptSurface() override {
    const auto view = appliance_.SurfaceSoFar();
    if (view == packed_view_) return packed_;
    packed_view_ = view;
    packed_ =
        view ? std::make_shared<const std::string>(CompactHeights(view->heights, view->missing))
             : nullptr;
    return packed_;
  }

  void Press(const Actor& actor, Done done) override {
    done(AnswerOf(appliance_.Press(ButtonPress::kShort, actor)));
  }

  void StartSweep(const Actor& actor, Done done) override {
    done(AnswerOf(appliance_.StartSweep(actor)));
  }

  void EndSweep(const Actor& actor, Done done) override {
    done(AnswerOf(appliance_.EndSweep(actor)));
  }

  void Cancel(const Actor& actor, Done done) override { done(AnswerOf(appliance_.Cancel(actor))); }

  void SetListener(std::function<void(web::EventKind)> listener) override {
    notices_.SetPage(std::move(listener));
  }

 private:
  Appliance& appliance_;
  const SensorThread& sensors_;
  OutlineWatch& outline_;
  Notices& notices_;
  std::shared_ptr<const std::string> preview_;
  std::optional<std::int64_t> preview_index_;  ///< Index of the frame that it shows.
  std::chrono::steady_clock::time_point preview_at_;
  std::shared_ptr<const LiveSurfaceView> packed_view_;  ///< Source of `packed_`.
  std::shared_ptr<const std::string> packed_;
};

}  // namespace

std::unique_ptr<web::ApplianceService> MakeWebAppliance(Appliance& appliance,
                                                        const SensorThread& sensors,
                                                        OutlineWatch& outline, Notices& notices) {
  return std::make_unique<WebAppliance>(appliance, sensors, outline, notices);
}

}  // namespace plumb
