// SPDX-License-Identifier: Apache-2.0
// The page's service for the state of the appliance and its button.
#include "daemon/services/web_services.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "daemon/files/compact_map.hpp"
#include "drivers/files/image_file.hpp"

namespace plumb {

namespace {

constexpr auto kPreviewEvery = std::chrono::milliseconds(200);
constexpr int kPreviewWidth = 320;
constexpr int kPreviewQuality = 70;

class WebAppliance final : public web::ApplianceService {
 public:
  WebAppliance(Appliance& appliance, const SensorThread& sensors, Notices& notices)
      : appliance_(appliance), sensors_(sensors), notices_(notices) {}

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
    cv::Mat small;
    const int width = std::min(kPreviewWidth, frame->color_rgb.cols);
    cv::resize(frame->color_rgb, small,
               {width, frame->color_rgb.rows * width / frame->color_rgb.cols}, 0, 0,
               cv::INTER_AREA);
    const std::vector<std::uint8_t> jpeg = EncodeJpeg(small, kPreviewQuality);
    preview_ = std::make_shared<const std::string>(jpeg.begin(), jpeg.end());
    preview_at_ = now;
    preview_index_ = frame->index;
    return preview_;
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
                                                        Notices& notices) {
  return std::make_unique<WebAppliance>(appliance, sensors, notices);
}

}  // namespace plumb
