// SPDX-License-Identifier: Apache-2.0
// Finds bytes in the head of a request that the HTTP library does not report.
#pragma once

#include <cstddef>
#include <cstring>

namespace plumb::web {

/// libmicrohttpd parses a head in place: it writes a zero over each separator and reports texts
/// that end at the first zero. After a zero byte that the client sent, a folded line or a line
/// without a carriage return, the gaps between these texts are too large or too small. A server in
/// front may read such a head in another way. Holds pointers into the library's buffer, which are
/// valid while the head is read.
class HeadLayout {
 public:
  HeadLayout() = default;
  HeadLayout(const char* method, const char* url, const char* version)
      : begin_(method), target_end_(url + std::strlen(url)), version_(version) {
    is_sound_ = method + std::strlen(method) + 1 == url;
    end_ = version + std::strlen(version) + kLineEnd;
  }

  /// In the order of the request. @param value  Null if there is none.
  void TakeQuery(const char* key, const char* value) {
    const char* const last = value != nullptr ? value : key;
    target_end_ = last + std::strlen(last);
  }
  /// In the order of the request. @return  Whether this line begins where the previous one ends.
  [[nodiscard]] bool TakeHeader(const char* key, const char* value) {
    const char* const last = value != nullptr ? value : key;
    const bool follows = key == end_;
    end_ = last + std::strlen(last) + kLineEnd;
    return follows;
  }
  /// To be called after the last header. A target that ends in "?" looks as if it had a zero byte,
  /// and is refused, too.
  /// @param size  Bytes of the head, with the empty line at its end.
  [[nodiscard]] bool IsWhole(std::size_t size) const {
    return is_sound_ && target_end_ + 1 == version_ && end_ + kLineEnd == begin_ + size;
  }

 private:
  static constexpr std::size_t kLineEnd = 2;

  const char* begin_ = nullptr;
  const char* target_end_ = nullptr;  ///< Of the address with its query.
  const char* version_ = nullptr;
  const char* end_ = nullptr;  ///< Where the next line begins.
  bool is_sound_ = false;
};

}  // namespace plumb::web
