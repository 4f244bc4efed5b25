// One request with its answer; a part of the transport.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "web/http/transport.hpp"

struct MHD_Connection;

namespace plumb::web {

/// Used on the loop thread.
struct Transport::Exchange : std::enable_shared_from_this<Transport::Exchange> {
  Transport* owner = nullptr;
  MHD_Connection* connection = nullptr;
  Request request;
  const Route* route = nullptr;
  bool head_only = false;
  bool malformed = false;
  int num_hosts = 0;
  bool started = false;
  bool suspended = false;
  std::optional<Response> response;
  std::shared_ptr<EventStream> stream;
  std::uint64_t uploaded = 0;  ///< Bytes of a file received so far.
  std::string unwritten;       ///< Those not yet passed to the disk.
  bool writing = false;        ///< A piece is being written.

  void Suspend();
  void Resume();
  void Answer(Response given);

  /// Appends a part of a body. @return  False: too long, the connection ends.
  [[nodiscard]] bool TakeBody(std::string_view bytes);
  /// True once the whole file is on the disk; otherwise the connection waits.
  [[nodiscard]] bool HasWholeUpload();

 private:
  void WriteUpload();
  void HaveWritten(const std::string& failure);
};

}  // namespace plumb::web
