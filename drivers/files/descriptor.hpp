// Descriptors of open files.
#pragma once

#include <unistd.h>

#include <filesystem>
#include <string_view>
#include <utility>

namespace plumb {

/// Owns a descriptor and closes it when it is destroyed.
class Descriptor {
 public:
  /// @param fd  Negative: there is none.
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(Descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  Descriptor& operator=(Descriptor&&) = delete;
  [[nodiscard]] int get() const { return fd_; }

 private:
  int fd_;
};

/// Writes all bytes, in as many calls as it takes. @param path  Named in the error.
/// @throws IoError with the text of DescribeWriteError().
void WriteAll(const Descriptor& file, std::string_view bytes, const std::filesystem::path& path);

}  // namespace plumb
