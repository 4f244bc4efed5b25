#include "daemon/appliance/web_appliance.hpp"

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

}  // namespace

std::shared_ptr<const std::string> WebAppliance::Preview() {
  const auto now = std::chrono::steady_clock::now();
  const std::optional<Frame> frame = appliance_.LatestFrame();
  if (!frame) {
    preview_.reset();
    return nullptr;
  }
  if (preview_ && (now - preview_at_ < kPreviewEvery || frame->index == preview_index_))
    return preview_;
  cv::Mat small;
  const int width = std::min(kPreviewWidth, frame->color_rgb.cols);
  cv::resize(frame->color_rgb, small,
             {width, frame->color_rgb.rows * width / frame->color_rgb.cols}, 0, 0, cv::INTER_AREA);
  const std::vector<std::uint8_t> jpeg = EncodeJpeg(small, kPreviewQuality);
  preview_ = std::make_shared<const std::string>(jpeg.begin(), jpeg.end());
  preview_at_ = now;
  preview_index_ = frame->index;
  return preview_;
}

std::shared_ptr<const std::string> WebAppliance::SweptSurface() {
  const auto view = appliance_.SurfaceSoFar();
  if (view == packed_view_) return packed_;
  packed_view_ = view;
  packed_ = view ? std::make_shared<const std::string>(CompactHeights(view->heights, view->missing))
                 : nullptr;
  return packed_;
}

void WebAppliance::Press(const web::Actor& actor, web::Done done) {
  done(AnswerOf(appliance_.Press(ButtonPress::kShort, actor)));
}

void WebAppliance::StartSweep(const web::Actor& actor, web::Done done) {
  done(AnswerOf(appliance_.StartSweep(actor)));
}

void WebAppliance::EndSweep(const web::Actor& actor, web::Done done) {
  done(AnswerOf(appliance_.EndSweep(actor)));
}

void WebAppliance::Cancel(const web::Actor& actor, web::Done done) {
  done(AnswerOf(appliance_.Cancel(actor)));
}

void WebAppliance::SetListener(std::function<void(web::EventKind)> listener) {
  listener_ = listener;
  appliance_.SetWebListener(std::move(listener));
}

void WebAppliance::Notify(web::EventKind kind) const {
  if (listener_) listener_(kind);
}

}  // namespace plumb
