// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/player/frame_cache.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "drivers/files/descriptor.hpp"

namespace plumb::simulated {
namespace {

constexpr char kMagic[8] = {'P', 'L', 'U', 'M', 'B', 'V', 'F', '1'};
constexpr std::size_t kHeaderBytes = sizeof kMagic + sizeof(FrameCacheShape);
constexpr std::uint32_t kMaxSide = 2560;
constexpr std::uint32_t kMaxFrames = 20000;

void ReadAt(int descriptor, void* data, std::size_t size, std::size_t offset) {
  const ssize_t got = ReadAllAt(descriptor, offset, {static_cast<std::byte*>(data), size});
  if (got != static_cast<ssize_t>(size))
    throw std::runtime_error(std::string("cannot read cached frames: ") +
                             (got >= 0 ? "file ends" : std::strerror(errno)));
}

}  // namespace

FrameCacheReader::FrameCacheReader(const std::filesystem::path& file) {
  descriptor_ = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor_ < 0)
    throw std::runtime_error("cannot open cached frames " + file.string() + ": " +
                             std::strerror(errno));
  try {
    char magic[sizeof kMagic];
    ReadAt(descriptor_, magic, sizeof magic, 0);
    ReadAt(descriptor_, &shape_, sizeof shape_, sizeof magic);
    struct stat status {};
    const bool sane = std::memcmp(magic, kMagic, sizeof magic) == 0 && shape_.width > 0 &&
                      shape_.width <= kMaxSide && shape_.height > 0 && shape_.height <= kMaxSide &&
                      shape_.num_frames > 0 && shape_.num_frames <= kMaxFrames &&
                      shape_.period_us > 0;
    const std::size_t expected =
        sane ? kHeaderBytes + shape_.num_frames * shape_.record_bytes() : 0;
    if (!sane || ::fstat(descriptor_, &status) != 0 ||
        static_cast<std::size_t>(status.st_size) != expected)
      throw std::runtime_error(file.string() + " is not a complete cache of frames; remove it");
  } catch (...) {
    ::close(descriptor_);
    throw;
  }
}

FrameCacheReader::~FrameCacheReader() { ::close(descriptor_); }

CachedStamps FrameCacheReader::Read(std::uint32_t frame, std::span<std::uint8_t> rgb,
                                    std::span<std::uint16_t> depth_mm) const {
  if (frame >= shape_.num_frames || rgb.size() != shape_.color_bytes() ||
      depth_mm.size_bytes() != shape_.depth_bytes())
    throw std::out_of_range("cached frame, or the memory for it");
  const std::size_t offset = kHeaderBytes + frame * shape_.record_bytes();
  CachedStamps stamps;
  ReadAt(descriptor_, &stamps, sizeof stamps, offset);
  ReadAt(descriptor_, rgb.data(), rgb.size(), offset + sizeof stamps);
  ReadAt(descriptor_, depth_mm.data(), depth_mm.size_bytes(), offset + sizeof stamps + rgb.size());
  return stamps;
}

std::string FrameCacheHeader(const FrameCacheShape& shape) {
  std::string header(kMagic, sizeof kMagic);
  header.append(reinterpret_cast<const char*>(&shape), sizeof shape);
  return header;
}

}  // namespace plumb::simulated
