// SPDX-License-Identifier: Apache-2.0
// plumb-file-reader FILE MAX_GAP_US: reads a recording of another program and writes what it states
// and its pairs of images to the standard output, in the protocol of drivers/stream.
//
// A separate process, because such files come from anywhere. Images are paired here.
#include <fcntl.h>
#include <sys/stat.h>

#include <algorithm>
#include <cstdlib>
#include <exception>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"
#include "drivers/files/descriptor.hpp"
#include "drivers/files/reader_program.hpp"
#include "drivers/importers/open_recorded_file.hpp"
#include "drivers/replay/tum_index.hpp"
#include "drivers/stream/stream_protocol.hpp"
#include "words/foreign.hpp"

namespace plumb {
namespace {

using nlohmann::ordered_json;
using stream::Header;
using stream::Kind;

void Send(Kind kind, const void* payload, std::size_t size, double stamp_s = 0.0) {
  Header header;
  header.kind = static_cast<std::uint32_t>(kind);
  header.size = size;
  header.stamp_us = static_cast<std::int64_t>(stamp_s * 1e6 + 0.5);
  WriteToParent(header);
  WriteToParent(payload, size);
}

void Send(Kind kind, const std::string& text) { Send(kind, text.data(), text.size()); }

void Send(Kind kind, const cv::Mat& image, double stamp_s) {
  Send(kind, image.data, image.total() * image.elemSize(), stamp_s);
}

FileBytes BytesOf(const Descriptor& file) {
  struct stat status {};
  if (::fstat(file.get(), &status) != 0 || !S_ISREG(status.st_mode))
    throw DataError(say::foreign::Unreadable());
  return {.size = static_cast<std::uint64_t>(status.st_size),
          .read = [fd = file.get()](std::uint64_t offset, std::span<std::uint8_t> bytes) {
            return ReadAllAt(fd, offset, std::as_writable_bytes(bytes)) ==
                   static_cast<ssize_t>(bytes.size());
          }};
}

std::vector<IndexEntry> Entries(const std::vector<double>& stamps_s) {
  std::vector<IndexEntry> entries;
  entries.reserve(stamps_s.size());
  for (const double time_s : stamps_s) entries.push_back({.time_s = time_s, .file = {}});
  return entries;
}

void SendHello(const RecordedFacts& facts, std::size_t num_pairs) {
  ordered_json depth_us = ordered_json::array();
  for (const double time_s : facts.depth_s)
    depth_us.push_back(static_cast<std::int64_t>(time_s * 1e6 + 0.5));
  ordered_json hello = {{"protocol", "plumb stream"},
                        {"version", stream::kVersion},
                        {"name", facts.name},
                        {"serial", facts.serial},
                        {"camera", facts.camera},
                        {"recording",
                         {{"format", facts.format},
                          {"firmware", facts.firmware},
                          {"class_by", facts.class_by},
                          {"stereo_baseline_m", nullptr},
                          {"pairs", num_pairs},
                          {"color_images", facts.color_s.size()},
                          {"depth_us", std::move(depth_us)},
                          {"warnings", EnglishTexts(facts.warnings)},
                          {"warning_messages", MessagesJson(facts.warnings)}}}};
  if (facts.stereo_baseline_m) hello["recording"]["stereo_baseline_m"] = *facts.stereo_baseline_m;
  Send(Kind::kHello, hello.dump(-1, ' ', false, ordered_json::error_handler_t::replace));
}

int Main(const std::string& file, double max_gap_s) try {
  const Descriptor opened = OpenForReading(file);
  if (opened.get() < 0) throw DataError(say::foreign::Unreadable());
  const std::unique_ptr<RecordedFile> recording = OpenRecordedFile(BytesOf(opened));
  const RecordedFacts& facts = recording->facts();
  const std::vector<IndexEntry> color = Entries(facts.color_s), depth = Entries(facts.depth_s);
  const std::vector<IndexPair> pairs =
      AssociateByTime(color, depth, LargestGap(color, depth, max_gap_s));
  SendHello(facts, pairs.size());
  for (const IndexPair& pair : pairs) {
    Send(Kind::kColor, recording->Color(pair.color), color[pair.color].time_s);
    Send(Kind::kDepth, recording->Depth(pair.depth), depth[pair.depth].time_s);
  }
  Send(Kind::kEnd, nullptr, 0);
  return 0;
} catch (const IoError&) {
  return 1;
} catch (const std::exception& error) {
  Send(Kind::kError, ReaderErrorText(error));
  return 3;
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  plumb::RunReaderProgram([&] { return plumb::Main(argv[1], 1e-6 * std::atof(argv[2])); });
}
