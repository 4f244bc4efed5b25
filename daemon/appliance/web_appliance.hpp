// The page's service for the state of the appliance and its button.
#pragma once

#include "daemon/appliance/store_access.hpp"
#include "web/service/appliance_service.hpp"

namespace plumb {

/// The appliance is borrowed.
class WebAppliance : public web::ApplianceService {
 public:
  explicit WebAppliance(Appliance& appliance) : appliance_(appliance) {}

  [[nodiscard]] web::Status GetStatus() override { return appliance_.WebStatus(); }
  [[nodiscard]] web::Health GetHealth() override { return appliance_.Health(); }
  [[nodiscard]] std::shared_ptr<const std::string> Preview() override;
  [[nodiscard]] std::shared_ptr<const std::string> SweptSurface() override;
  void Press(const web::Actor& actor, web::Done done) override;
  void StartSweep(const web::Actor& actor, web::Done done) override;
  void EndSweep(const web::Actor& actor, web::Done done) override;
  void Cancel(const web::Actor& actor, web::Done done) override;
  void SetListener(std::function<void(web::EventKind)> listener) override;

  /// Notifies the listener, if there is one.
  void Notify(web::EventKind kind) const;

 private:
  Appliance& appliance_;
  std::function<void(web::EventKind)> listener_;
  std::shared_ptr<const std::string> preview_;
  std::optional<std::int64_t> preview_index_;  ///< Index of the frame that it shows.
  std::chrono::steady_clock::time_point preview_at_;
  std::shared_ptr<const LiveSurfaceView> packed_view_;  ///< Source of `packed_`.
  std::shared_ptr<const std::string> packed_;
};

}  // namespace plumb
