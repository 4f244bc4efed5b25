// SPDX-License-Identifier: Apache-2.0
#include "drivers/dicom/planning_files.hpp"

#include <fcntl.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "algo/base/errors.hpp"
#include "drivers/dicom/dicom_program.hpp"
#include "drivers/dicom/planning_wire.hpp"
#include "drivers/files/descriptor.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/reader_process.hpp"
#include "words/dicom.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

PlanningContent AskReader(const fs::path& file) {
  DicomProgram reader("plumb-dicom-reader", {file.string()});
  PlanningHeader header;
  reader.Read(&header, sizeof header);
  if (header.magic != PlanningHeader::kMagic || header.text_bytes > kMostFactBytes ||
      header.num_numbers > 3 * kMostContourPoints)
    throw DataError(say::dicom::ReaderVersion());
  std::string text(static_cast<std::size_t>(header.text_bytes), ' ');
  reader.Read(text.data(), text.size());
  if (header.is_error != 0) throw DataError(ReaderErrorOf(text));
  std::vector<double> numbers(static_cast<std::size_t>(header.num_numbers));
  reader.Read(numbers.data(), numbers.size() * sizeof(double));
  return ParsePlanning(text, numbers);
}

/// DICOM files of a folder, not of those in it.
std::vector<fs::path> DicomFilesIn(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code error;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error))
    if (IsDicomFile(at->path())) files.push_back(at->path());
  if (error) throw DataError(say::dicom::Damaged(folder.string(), say::dicom::CannotRead()));
  if (files.empty()) throw DataError(say::dicom::NoImages(folder.string()));
  std::ranges::sort(files);
  return files;
}

std::string SaidName(const fs::path& file, const fs::path& name) {
  return (name.empty() ? file : name).string();
}

CtImage ImageOf(PlanningContent content, const std::string& name) {
  if (!content.image_fault.empty()) throw DataError(say::dicom::Damaged(name, content.image_fault));
  if (!content.image)
    throw DataError(say::dicom::OtherKind(name, content.modality, say::dicom::KindImage()));
  return *std::move(content.image);
}

}  // namespace

bool IsDicomFile(const fs::path& file) {
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return false;
  const Descriptor opened = OpenForReading(file);
  std::array<char, 132> first{};
  return opened.get() >= 0 &&
         ReadAllAt(opened.get(), 0, std::as_writable_bytes(std::span(first))) ==
             static_cast<ssize_t>(first.size()) &&
         std::string_view(first.data() + 128, 4) == "DICM";
}

PlanningContent ReadDicomFile(const fs::path& file, const fs::path& name) {
  std::error_code error;
  if (!fs::exists(file, error)) throw DataError(say::dicom::NoFile(SaidName(file, name)));
  try {
    return AskReader(fs::absolute(file));
  } catch (const DataError& why) {
    throw DataError(say::dicom::Damaged(SaidName(file, name), why.message()));
  }
}

StructureSet ReadStructureSet(const fs::path& file, const fs::path& name) {
  PlanningContent content = ReadDicomFile(file, name);
  if (!content.structures)
    throw DataError(say::dicom::OtherKind(SaidName(file, name), content.modality,
                                          say::dicom::KindStructures()));
  return *std::move(content.structures);
}

TreatmentPlan ReadTreatmentPlan(const fs::path& file, const fs::path& name) {
  PlanningContent content = ReadDicomFile(file, name);
  if (!content.plan)
    throw DataError(
        say::dicom::OtherKind(SaidName(file, name), content.modality, say::dicom::KindPlan()));
  return *std::move(content.plan);
}

CtImage ReadCtImage(const fs::path& file, const fs::path& name) {
  return ImageOf(ReadDicomFile(file, name), SaidName(file, name));
}

void ForEachCtImage(const std::vector<fs::path>& paths, const CtImageVisit& visit) {
  for (const fs::path& path : paths) {
    const bool is_folder = fs::is_directory(path);
    for (const fs::path& file : is_folder ? DicomFilesIn(path) : std::vector{path}) {
      PlanningContent content = ReadDicomFile(file);
      if (is_folder && (content.structures || content.plan)) continue;
      visit(ImageOf(std::move(content), file.string()), file.string());
    }
  }
}

}  // namespace plumb
