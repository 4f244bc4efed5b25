// SPDX-License-Identifier: Apache-2.0
// One request with its answer.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "web/http/event_hub.hpp"
#include "web/http/head_layout.hpp"
#include "web/http/message.hpp"
#include "web/http/router.hpp"
#include "web/http/server_options.hpp"
#include "web/service/background_work.hpp"

struct MHD_Connection;

namespace plumb::web {

/// Used on the loop thread.
struct Exchange : std::enable_shared_from_this<Exchange> {
  /// Everything is borrowed. @param wake_loop  Called when an answer can be sent.
  Exchange(const HttpServerOptions& limits, BackgroundWork& writes, std::function<void()> wake_loop,
           MHD_Connection* of)
      : options(limits), background(writes), wake(std::move(wake_loop)), connection(of) {}

  const HttpServerOptions& options;
  BackgroundWork& background;
  const std::function<void()> wake;
  MHD_Connection* const connection;
  Request request;
  const Route* route = nullptr;
  bool head_only = false;
  bool malformed = false;
  HeadLayout head;
  int num_hosts = 0;
  bool started = false;
  bool suspended = false;
  std::optional<Response> response;
  std::shared_ptr<EventStream> stream;
  std::uint64_t uploaded = 0;  ///< Bytes of a file received so far.
  std::string unwritten;       ///< Those not yet passed to the disk.
  bool writing = false;        ///< A piece is being written.
  std::string fetched;         ///< The next piece of a file that the disk has been waited for.
  bool fetch_failed = false;
  /// Resume() is due then: there was no place for the question for that piece.
  std::optional<std::chrono::steady_clock::time_point> try_again_at;

  void Suspend();
  void Resume();
  void Answer(Response given);

  /// Appends a part of a body. @return  False: too long, the connection ends.
  [[nodiscard]] bool TakeBody(std::string_view bytes);
  /// True once the whole file is on the disk; otherwise the connection waits.
  [[nodiscard]] bool HasWholeUpload();
  /// The next piece of the file that is the answer; 0: the connection waits until the disk has
  /// given it. Nothing if it cannot be read.
  [[nodiscard]] std::optional<std::size_t> NextPiece(std::uint64_t at, std::span<char> into);

 private:
  void Fetch(std::uint64_t at, std::size_t most);
  void WriteUpload();
  void HaveWritten(const Message& failure);
};

}  // namespace plumb::web
