// SPDX-License-Identifier: Apache-2.0
// plumb-dicom-reader FILE: reads a DICOM file and writes what Plumb takes from it to the standard
// output, as planning_wire.hpp says.
//
// A separate process, because such files come from anywhere and DCMTK has had its memory errors:
// 512 MB, 10 s, and no right to open, reach or start anything once the file is in memory.
#include <fcntl.h>
#include <sys/stat.h>

#include <cstdint>
#include <exception>
#include <new>
#include <span>
#include <string>
#include <vector>

#include "algo/base/errors.hpp"
#include "drivers/dicom/dicom_objects.hpp"
#include "drivers/dicom/lock_down.hpp"
#include "drivers/dicom/planning_wire.hpp"
#include "drivers/files/descriptor.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/reader_program.hpp"
#include "words/dicom.hpp"

namespace plumb {
namespace {

constexpr ReaderLimits kDicomLimits{.memory_bytes = std::uint64_t{512} << 20, .cpu_s = 10};

std::vector<std::uint8_t> BytesOf(const std::string& file) {
  const Descriptor opened = OpenForReading(file);
  struct stat status {};
  if (opened.get() < 0 || ::fstat(opened.get(), &status) != 0 || !S_ISREG(status.st_mode))
    throw DataError(say::dicom::CannotRead());
  if (static_cast<std::uint64_t>(status.st_size) > kMostDicomBytes)
    throw DataError(say::dicom::TooLarge(static_cast<std::int64_t>(kMostDicomBytes >> 20)));
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(status.st_size));
  if (ReadAllAt(opened.get(), 0, std::as_writable_bytes(std::span(bytes))) !=
      static_cast<ssize_t>(bytes.size()))
    throw DataError(say::dicom::CannotRead());
  return bytes;
}

int Fail(const std::exception& error) {
  const std::string text = ReaderErrorText(error);
  WriteToParent(PlanningHeader{.is_error = 1, .text_bytes = text.size()});
  WriteToParent(text.data(), text.size());
  return 3;
}

int Main(const std::string& file) try {
  PrepareDicom();
  const std::vector<std::uint8_t> bytes = BytesOf(file);
  LockDown();
  const PlanningContent content = ReadDicom(bytes);
  const std::string facts = FactsOf(content);
  const std::vector<double> points = PointsOf(content);
  if (facts.size() > kMostFactBytes)
    throw DataError(say::dicom::TooLarge(static_cast<std::int64_t>(kMostFactBytes >> 20)));
  WriteToParent(PlanningHeader{.text_bytes = facts.size(), .num_numbers = points.size()});
  WriteToParent(facts.data(), facts.size());
  WriteToParent(points.data(), points.size() * sizeof(double));
  return 0;
} catch (const std::bad_alloc&) {
  return Fail(DataError(say::dicom::TooMuchMemory()));
} catch (const std::exception& error) {
  return Fail(error);
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  plumb::RunReaderProgram([&] { return plumb::Main(argv[1]); }, plumb::kDicomLimits);
}
