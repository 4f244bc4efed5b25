// SPDX-License-Identifier: Apache-2.0
#include "web/api/http_server.hpp"

#include <sys/epoll.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "algo/base/errors.hpp"
#include "web/api/accounts.hpp"
#include "web/api/all_routes.hpp"
#include "web/api/disclosures.hpp"
#include "web/api/display_view.hpp"
#include "web/exchange/json.hpp"
#include "web/http/checks.hpp"
#include "web/http/transport.hpp"
#include "web/page/assets.hpp"
#include "words/web.hpp"

namespace plumb::web {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kBeat{2000};
constexpr std::chrono::milliseconds kExpireEvery{
    500};  // while somebody watches, so that the end of a session is shown within a second
constexpr std::chrono::milliseconds kMinEventGap{100};
constexpr std::chrono::milliseconds kCutEvery{1000};

HttpServerOptions Completed(HttpServerOptions options) {
  if (!options.now) options.now = [] { return SteadyClock::now(); };
  if (!options.wall_now) options.wall_now = [] { return std::chrono::system_clock::now(); };
  if (!options.make_certificate)
    options.make_certificate = [names = options.host_names](const auto now) {
      return MakeTlsIdentity(names, now);
    };
  if (!options.is_clock_trusted) options.is_clock_trusted = [] { return true; };
  return options;
}

std::string_view Name(EventKind kind) {
  switch (kind) {
    case EventKind::kResult:
      return "result";
    case EventKind::kData:
      return "data";
    case EventKind::kUpdate:
      return "update";
    case EventKind::kMonitor:
      return "monitor";
    case EventKind::kStatus:
    case EventKind::kProgress:
      break;
  }
  return "status";
}

}  // namespace

class HttpServer::Impl {
 public:
  Impl(const Services& services, HttpServerOptions options)
      : appliance_(services.appliance),
        monitoring_(services.monitoring),
        options_(Completed(std::move(options))),
        accounts_(services, options_, CertificateReplacer()),
        hub_({.all = options_.max_event_streams,
              .of_account = options_.max_streams_per_account,
              .of_session = options_.max_streams_per_session,
              .buffer_bytes = options_.event_buffer_bytes}),
        transport_(options_, services.background, router_, accounts_, hub_,
                   [this](EventStream& stream) { stream.Send(StatusEvent()); }) {
    Routes routes(router_, services.background);
    accounts_.AddRoutes(routes);
    AddPatientApi(routes, services);
    AddPlanningApi(routes, services);
    AddScanApi(routes, services);
    AddUnitApi(routes, services);
    AddMetricsRoute(routes, services.appliance, options_.metrics_token,
                    [this] { return accounts_.CertificateLeft(); });
    AddPeerRoute(routes, services.appliance, options_.peer_secret);
    AddMonitorApi(routes, services);
    AddResultPage(routes, services);
    AddExportRoutes(routes, services);
    AddSensorRoutes(routes, services);
    AddStatisticsRoutes(routes, services);
    AddRoomCalibrationRoutes(routes, services);
    LimitDisplays(router_, services);
    LogDisclosures(router_, services.audit, options_.now);
    AddPageRoutes(routes);
    epoll_fd_ = epoll_create1(EPOLL_CLOEXEC);
    if (epoll_fd_ < 0) throw IoError(say::web::CannotMakeEpoll(std::strerror(errno)));
    Watch(transport_.fd());
    Watch(transport_.wake_fd());
    Watch(accounts_.fd());
    next_beat_ = SteadyClock::now() + kBeat;
    appliance_.SetListener([this](EventKind kind) { OnEvent(kind); });
  }

  ~Impl() {
    appliance_.SetListener({});
    hub_.CloseAll();
    close(epoll_fd_);
  }

  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  [[nodiscard]] int fd() const { return epoll_fd_; }
  [[nodiscard]] Accounts& accounts() { return accounts_; }
  [[nodiscard]] const Transport& transport() const { return transport_; }
  [[nodiscard]] const Router& router() const { return router_; }

  void Run() {
    {
      const ScopedLoopLabel label(options_, "passwords");
      accounts_.Dispatch();
    }
    const auto now = SteadyClock::now();
    if (status_due_ && now >= *status_due_) SendStatus(now);
    if (hub_.size() > 0 && now >= next_expiry_) {
      next_expiry_ = now + kExpireEvery;
      accounts_.Expire();
    }
    if (now >= next_beat_) {
      next_beat_ = now + kBeat;
      accounts_.Expire();
      accounts_.CareForCertificate();
      hub_.Beat();
    }
    transport_.Run();  // first: requests that have arrived by now are not late
    if (now >= next_cut_) {
      // After a pause of the appliance itself, clients get the lost time back.
      const bool was_paused = transport_.has_connections() && now > next_cut_ + 2 * kCutEvery;
      next_cut_ = now + kCutEvery;
      if (!was_paused) transport_.CutLate();
      // The answer to the person who replaced the certificate has been sent by now. Browsers
      // connect again at once, and see the new one.
      if (cut_before_ && options_.now() - *cut_before_ >= kCutEvery)
        transport_.CutOlderThan(*std::exchange(cut_before_, std::nullopt));
    }
    if (hub_.EndOver())
      transport_.Run();  // a log-out that has just arrived ends its own streams at once
  }

  [[nodiscard]] std::optional<std::chrono::milliseconds> timeout() const {
    const auto now = SteadyClock::now();
    auto due = next_beat_;
    if (hub_.size() > 0) due = std::min(due, next_expiry_);
    if (transport_.has_connections()) due = std::min(due, next_cut_);
    if (status_due_) due = std::min(due, *status_due_);
    auto wait = std::max(std::chrono::milliseconds(0),
                         std::chrono::ceil<std::chrono::milliseconds>(due - now));
    if (const auto own = transport_.timeout()) wait = std::min(wait, *own);
    return wait;
  }

 private:
  [[nodiscard]] std::function<void(const TlsIdentity&)> CertificateReplacer() {
    if (!options_.tls || !options_.keep_certificate) return {};
    return [this](const TlsIdentity& identity) {
      transport_.Serve(identity);
      cut_before_ = options_.now();
    };
  }

  void Watch(int watched) {
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.fd = watched;
    if (epoll_ctl(epoll_fd_, EPOLL_CTL_ADD, watched, &event) != 0)
      throw IoError(say::web::CannotWatch(std::strerror(errno)));
  }

  static void AddPageRoutes(Routes& routes) {
    const auto serve = [](const Request& request) {
      const bool is_page = request.path == "/room" || request.path == "/breath";
      const Asset* asset = FindAsset(is_page ? "/" : request.path);
      if (asset == nullptr) return ErrorResponse(404, say::web::NoSuchFile());
      const auto accepted = request.headers.find("accept-encoding");
      Response response;
      response.type = std::string(asset->type);
      response.cache_for_ever = asset->hashed;
      response.headers.emplace_back("Vary", "Accept-Encoding");
      response.constant_body = asset->plain;
      if (AcceptsGzip(accepted == request.headers.end()
                          ? std::optional<std::string_view>("identity")
                          : accepted->second)) {
        response.constant_body = asset->gzip;
        response.headers.emplace_back("Content-Encoding", "gzip");
      }
      return response;
    };
    for (const char* pattern : {"/", "/room", "/breath", "/assets/{name}"})
      routes.Read(pattern, Permission::kNone, serve);
    routes.Read("/api/v1/events", Permission::kRoom, [](const Request&) {
      Response response = BodyResponse("text/event-stream", "");
      response.event_stream = true;
      response.headers.emplace_back("X-Accel-Buffering", "no");  // nginx would hold events back
      return response;
    });
  }

  [[nodiscard]] std::string StatusEvent() {
    return FormatEvent("status", Dump(ToJson(appliance_.GetStatus(), WallClock::now())));
  }

  void SendStatus(SteadyClock::time_point now) {
    status_due_.reset();
    last_status_ = now;
    const ScopedLoopLabel label(options_, "status to viewers");
    if (hub_.size() > 0)
      hub_.Broadcast("status", Dump(ToJson(appliance_.GetStatus(), WallClock::now())));
  }

  /// The state is sent at once but at most ten times a second; the other events only ask the page
  /// to reload.
  void OnEvent(EventKind kind) {
    if (kind == EventKind::kMonitor) {
      if (hub_.size() > 0) hub_.Broadcast(Name(kind), Dump(MonitorJson(monitoring_.GetMonitor())));
      return;
    }
    if (kind != EventKind::kStatus && kind != EventKind::kProgress)
      hub_.Broadcast(Name(kind), "{}");
    if (kind == EventKind::kData || kind == EventKind::kUpdate) return;
    if (!status_due_) status_due_ = std::max(SteadyClock::now(), last_status_ + kMinEventGap);
    transport_.Wake();
  }

  ApplianceService& appliance_;
  MonitoringService& monitoring_;
  HttpServerOptions options_;
  Router router_;
  Accounts accounts_;
  EventHub hub_;
  Transport transport_;
  int epoll_fd_ = -1;
  SteadyClock::time_point next_beat_;
  SteadyClock::time_point next_expiry_;
  SteadyClock::time_point next_cut_;
  SteadyClock::time_point last_status_;
  std::optional<SteadyClock::time_point> status_due_;
  std::optional<SteadyClock::time_point> cut_before_;  ///< A certificate was replaced then.
};

HttpServer::HttpServer(const Services& services, HttpServerOptions options)
    : impl_(std::make_unique<Impl>(services, std::move(options))) {}
HttpServer::~HttpServer() = default;
int HttpServer::fd() const { return impl_->fd(); }
void HttpServer::Run() { impl_->Run(); }
std::optional<std::chrono::milliseconds> HttpServer::timeout() const { return impl_->timeout(); }
std::uint16_t HttpServer::port() const { return impl_->transport().port(); }
std::optional<std::string> HttpServer::setup_code() const { return impl_->accounts().setup_code(); }
std::string HttpServer::presence_code() { return impl_->accounts().presence_code(); }
const std::vector<Route>& HttpServer::routes() const { return impl_->router().routes(); }

}  // namespace plumb::web
