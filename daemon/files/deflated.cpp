#include "daemon/files/deflated.hpp"

#include <zlib.h>

#include "algo/base/errors.hpp"

namespace plumb {

std::string Deflated(std::string_view bytes) {
  constexpr int kLevel = 6;
  uLongf size = compressBound(bytes.size());
  std::string stream(size, '\0');
  if (compress2(reinterpret_cast<Bytef*>(stream.data()), &size,
                reinterpret_cast<const Bytef*>(bytes.data()), bytes.size(), kLevel) != Z_OK)
    throw IoError("not enough memory to pack what a browser asked for");
  stream.resize(size);
  return stream;
}

}  // namespace plumb
