// Compression of what is sent to a browser, which unpacks it by itself.
#pragma once

#include <string>
#include <string_view>

namespace plumb {

/// A zlib stream of the bytes. @throws IoError without memory
[[nodiscard]] std::string Deflated(std::string_view bytes);

}  // namespace plumb
