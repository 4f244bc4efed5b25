// SPDX-License-Identifier: Apache-2.0
// The listening address of the server and the limits for its clients.
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

#include "web/security/directory_answer.hpp"
#include "web/security/tls_identity.hpp"

namespace plumb::web {

struct HttpServerOptions {
  std::string address = "127.0.0.1";  ///< IPv4 or IPv6 address to listen on.
  std::uint16_t port = 0;             ///< 0: any free one, see port().
  /// A listening socket passed in (socket activation); address and port are then unused.
  std::optional<int> listen_fd;
  std::optional<TlsIdentity> tls;  ///< HTTPS instead of HTTP; see CheckedTlsIdentity().
  /// Stores an identity durably for the next start; one that a person set only after a browser has
  /// connected with it. Throws IoError, after which the previous one stays. Empty: the certificate
  /// cannot be replaced on the page.
  std::function<void(const TlsIdentity&)> keep_certificate;
  /// Makes one of the unit's own, such as by its authority; throws. Empty: a self-signed one.
  std::function<TlsIdentity(std::chrono::system_clock::time_point)> make_certificate;
  /// For tests: this machine's addresses.
  std::function<std::vector<std::string>()> own_addresses = OwnAddresses;
  /// Called with every identity that replaces another. May be empty.
  std::function<void(const TlsIdentity&)> on_certificate;
  /// Called when strangers begin to guess passwords faster than permitted, and again when none has
  /// done so for ten minutes. May be empty.
  std::function<void(bool are_running)> on_guesses;
  /// Asks the clinic's directory about people without an account of this unit's own. Empty: there
  /// is none.
  AskDirectory ask_directory;
  /// 32 random bytes that outlive a restart, for the cookies of browsers that logged in before.
  /// Empty: new ones are created, so that a restart forgets those browsers.
  std::string device_key;
  /// Accepted in the Host header in addition to localhost and numeric addresses.
  std::vector<std::string> host_names;
  /// What a monitoring system sends as its bearer token to read /metrics; empty: there is no such
  /// page.
  std::string metrics_token;
  /// What the other units of the clinic send as theirs to ask whether a patient is open here;
  /// empty: none is answered.
  std::string peer_secret;
  /// Limits of open connections: strangers may use the first number. Beyond it, or beyond the
  /// second from one address, the oldest connection of the address with the most is closed. The
  /// rest is for logged-in browsers and for this machine itself.
  unsigned max_connections = 256;
  unsigned max_strangers = 128;
  unsigned max_strangers_per_address = 64;
  std::size_t max_body_bytes =
      64 << 10;  ///< Three times a plan of 500 corners; parsing the worst of that size takes 2 ms.
  std::filesystem::path upload_folder;  ///< Folder for incoming bundles; empty: none are accepted.
  std::uint64_t max_upload_bytes = std::uint64_t{2} << 30;
  std::chrono::seconds upload_limit{15 * 60};  ///< Replaces request_limit for uploads.
  /// Limit of all answers in memory that have not been sent yet: slow readers of large ones must
  /// not use up the memory. Beyond it answers are refused with 503, except small ones.
  std::size_t max_unsent_bytes = std::size_t{256} << 20;
  std::size_t small_answer_bytes = std::size_t{1} << 20;
  std::size_t connection_memory_bytes = 32 << 10;  ///< For request line, headers and their parsing.
  /// A connection without any traffic is closed after this time.
  std::chrono::seconds request_timeout{15};
  /// For clients that are not logged in: time until the head of the first request is complete,
  /// including TLS, and between an answer and the head of the next request.
  std::chrono::seconds header_limit{10};
  /// Time until a request is complete, even if it trickles in.
  std::chrono::seconds request_limit{60};
  std::size_t event_buffer_bytes =
      64 << 10;  ///< Per viewer of the event stream; one that falls behind is dropped.
  unsigned max_event_streams = 32;
  /// Above these numbers the oldest stream of the account or of the session ends; above the number
  /// of all streams, the oldest of the account with the most.
  unsigned max_streams_per_account = 16, max_streams_per_session = 6;
  std::uint64_t password_memory_bytes = 64 << 20;  ///< For argon2id; one hash runs at a time.
  std::uint64_t password_operations = 3;
  /// A session ends after this time even if it is used.
  std::chrono::seconds session_limit{12 * 3600};
  std::function<std::chrono::steady_clock::time_point()>
      now;  ///< For tests; empty: the steady clock.
  std::function<std::chrono::system_clock::time_point()>
      wall_now;  ///< For tests; empty: the wall clock. Of the certificate's dates only.
  /// Whether the wall clock may decide that the unit's own certificate is renewed. Empty: it may.
  std::function<bool()> is_clock_trusted;
  /// Called with the present activity of Run(): "GET /api/v1/scans/{id}" from the table of routes,
  /// and an empty text afterwards. May be empty.
  std::function<void(std::string_view what)> doing;
};

}  // namespace plumb::web
