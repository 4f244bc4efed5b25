// Where the server listens, and every limit that it holds browsers to.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "web/security/tls_identity.hpp"

namespace plumb::web {

struct HttpServerOptions {
  std::string address = "127.0.0.1";  ///< IPv4 or IPv6 address to listen on.
  std::uint16_t port = 0;             ///< 0: any free one, see port().
  std::optional<int> listen_fd;    ///< A listening socket from outside (socket activation); address
                                   ///< and port are then unused.
  std::optional<TlsIdentity> tls;  ///< HTTPS instead of HTTP; see CheckedTlsIdentity().
  /// Keeps another one durably, before it is served. Throws IoError, and then the one before stays.
  /// Empty: the certificate cannot be replaced on the page.
  std::function<void(const TlsIdentity&)> keep_certificate;
  /// 32 random bytes that outlive a restart, for the cookies of browsers that logged in before.
  /// Empty: made anew, so that a restart forgets those browsers.
  std::string device_key;
  std::vector<std::string> host_names;  ///< Accepted in the Host header beside localhost and
                                        ///< addresses written as numbers.
  /// Of all that are open at once those of strangers have the first number; beyond it, or beyond
  /// the second from one address, the oldest of the address with the most is closed. The rest is
  /// for logged-in browsers and for this machine itself.
  unsigned max_connections = 256;
  unsigned max_strangers = 128;
  unsigned max_strangers_per_address = 64;
  std::size_t max_body_bytes =
      64 << 10;  ///< Three times a plan of 500 corners; parsing the worst of that size takes 2 ms.
  std::filesystem::path
      upload_folder;  ///< Where bundles are written while they come; empty: none are taken.
  std::uint64_t max_upload_bytes = std::uint64_t{2} << 30;
  std::chrono::seconds upload_limit{15 * 60};      ///< In place of request_limit.
  std::size_t connection_memory_bytes = 32 << 10;  ///< Request line, headers and their parsing.
  std::chrono::seconds request_timeout{15};  ///< A connection on which nothing moves is closed.
  /// Of who has not logged in: the head of the first request must be there by then, TLS included,
  /// and the head of each further one as long after the answer before it.
  std::chrono::seconds header_limit{10};
  std::chrono::seconds request_limit{60};  ///< A request must be whole by then, however it drips.
  std::size_t event_buffer_bytes =
      64 << 10;  ///< Per viewer of the event stream; one that falls behind is dropped.
  unsigned max_event_streams = 32;
  unsigned max_streams_per_session = 6;            ///< Beyond, the oldest of the session ends.
  std::uint64_t password_memory_bytes = 64 << 20;  ///< Of argon2id; one hash runs at a time.
  std::uint64_t password_operations = 3;
  std::chrono::seconds session_limit{12 * 3600};  ///< A session ends then, however busy.
  std::function<std::chrono::steady_clock::time_point()>
      now;  ///< For tests; empty: the steady clock.
  /// Told what Run() is about to do: "GET /api/v1/scans/{id}", of the routes' table, and an empty
  /// text after it. May be empty.
  std::function<void(std::string_view what)> doing;
};

}  // namespace plumb::web
