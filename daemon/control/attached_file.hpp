// SPDX-License-Identifier: Apache-2.0
// An open file that is sent along with a request.
#pragma once

#include <unistd.h>

namespace plumb {

class AttachedFile {
 public:
  /// Takes ownership of the descriptor.
  explicit AttachedFile(int fd) : fd_(fd) {}
  ~AttachedFile() {
    if (fd_ >= 0) ::close(fd_);
  }
  AttachedFile(const AttachedFile&) = delete;
  AttachedFile& operator=(const AttachedFile&) = delete;
  [[nodiscard]] int fd() const { return fd_; }

 private:
  int fd_;
};

}  // namespace plumb
