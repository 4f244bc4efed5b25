// SPDX-License-Identifier: Apache-2.0
#include "daemon/dicom/result_export.hpp"

#include <array>
#include <cctype>
#include <ctime>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/base/units.hpp"
#include "algo/planning/iec_axes.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/mesh_formats/mesh_file.hpp"
#include "daemon/reports/result_report.hpp"
#include "daemon/result/result_folder.hpp"
#include "daemon/scan_files/scan_files.hpp"
#include "drivers/dicom/dicom_export.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "drivers/files/temporary.hpp"
#include "words/dicom.hpp"
#include "words/output.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostSceneText = std::size_t{64} << 20;
constexpr std::array<std::string_view, 5> kExportFiles = {
    "report.dcm", "error_map.dcm", "overlay.dcm", "surface.dcm", "registration.dcm"};

/// A scene's own frame has no identifier; its contents give it one, the same for each export.
std::string FrameDigest(const fs::path& scene) {
  return Sha256Of("frame " + ReadTextFile(scene / "scene.json", kMostSceneText));
}

/// Makes the objects of one export, which share patient, study and time.
class ExportMaker {
 public:
  ExportMaker(const ResultExportRequest& request, const Catalogue& language)
      : request_(request),
        language_(language),
        result_(ReadResult(request.result)),
        reference_(ReadStoredScene(request.reference).scene),
        current_(ReadScene(request.current, {.cloud = false, .height_map = false, .mesh = true})),
        reference_frame_(FrameDigest(request.reference)),
        current_frame_(FrameDigest(request.current)),
        now_(std::time(nullptr)),
        study_(Sha256Of(fmt::format("study {} {} {}", ResultText(result_), current_frame_, now_))) {
    CheckTheyBelongTogether();
    code_ = "PLUMB-" + reference_frame_.substr(0, 8);
    for (char& c : code_) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  }

  ResultExport Make() {
    AddPictures();
    AddReport();
    AddSurface();
    AddRegistration();
    return std::move(made_);
  }

 private:
  void CheckTheyBelongTogether() const {
    const std::string plan = reference_.planning ? reference_.planning->plan_uid : std::string();
    const std::string compared = result_.compared_with ? result_.compared_with->plan_uid : "";
    if (plan != compared)
      throw DataError(
          say::dicom::OtherReference(request_.result.string(), request_.reference.string()));
    if (!result_.alignment) return;
    for (const int id : result_.alignment->markers_used)
      if (!current_.markers.contains(id))
        throw DataError(
            say::dicom::OtherCurrent(request_.result.string(), request_.current.string(), id));
  }

  [[nodiscard]] std::string Now(const char* format) const {
    std::tm local{};
    ::localtime_r(&now_, &local);
    std::array<char, 64> text{};
    return {text.data(), std::strftime(text.data(), text.size(), format, &local)};
  }

  DicomExport Common(DicomExportKind kind, const Message& title) const {
    const auto series = static_cast<std::int64_t>(kind) + 1;
    DicomExport object;
    object.kind = kind;
    object.patient_id = request_.patient_id.empty() ? code_ : request_.patient_id;
    object.patient_name = request_.patient_name.empty() ? object.patient_id : request_.patient_name;
    object.study_uid = UidOfDigest(study_);
    object.series_uid = UidOfDigest(Sha256Of(fmt::format("series {} {}", study_, series)));
    object.series_number = series;
    object.date = Now("%Y%m%d");
    object.time = Now("%H%M%S");
    object.title = Text(title, language_);
    object.version = result_.version;
    return object;
  }

  void Add(std::string_view name, DicomExport object) {
    Sha256 hash;
    const std::string head = fmt::format("instance {} {}", study_, name);
    hash.Add(head.data(), head.size());
    hash.Add(object.payload.data(), object.payload.size());
    object.instance_uid = UidOfDigest(hash.Hex());
    made_.objects.push_back({.file_name = std::string(name), .object = std::move(object)});
  }

  void AddPictures() {
    std::int64_t number = 1;
    for (const auto& [file, name, title] :
         {std::tuple("error_map.png", kExportFiles[1], say::dicom::TitlePicture()),
          std::tuple("overlay.png", kExportFiles[2], say::dicom::TitleOverlay())}) {
      const fs::path path = request_.result / file;
      if (!fs::exists(path)) continue;
      const cv::Mat picture = ReadColorImage(path);
      pictures_.push_back(picture);
      DicomExport object = Common(DicomExportKind::kPicture, title);
      object.instance_number = number++;
      object.width = picture.cols;
      object.height = picture.rows;
      const cv::Mat whole = picture.isContinuous() ? picture : picture.clone();
      object.payload.assign(whole.data, whole.data + whole.total() * whole.elemSize());
      Add(name, std::move(object));
    }
  }

  void AddReport() {
    DicomExport object = Common(DicomExportKind::kReport, say::dicom::TitleReport());
    if (request_.report) {
      object.payload = ReadWholeFile(*request_.report, kMostExportBytes);
      constexpr std::string_view kPdf = "%PDF-";
      if (object.payload.size() < kPdf.size() ||
          !std::equal(kPdf.begin(), kPdf.end(), object.payload.begin()))
        throw DataError(say::dicom::NotPdf(request_.report->string()));
    } else {
      ScanReport report = DescribeResult(result_, object.patient_id, Now("%Y-%m-%d %H:%M %Z"),
                                         pictures_, language_);
      report.paper = request_.paper;
      const std::string pdf = PdfOf(report);
      object.payload.assign(pdf.begin(), pdf.end());
    }
    Add(kExportFiles[0], std::move(object));
  }

  void AddSurface() {
    if (current_.mesh.triangles.empty()) {
      made_.left_out.push_back(say::dicom::NoSurface());
      return;
    }
    DicomExport object = Common(DicomExportKind::kSurface, say::dicom::TitleSurface());
    object.frame_uid = UidOfDigest(current_frame_);
    const TemporaryFolder folder(fs::temp_directory_path(), "plumb-export-");
    WriteMeshFile(folder.path() / "surface.stl", current_.mesh, MeshUnit::kMillimetres);
    object.payload = ReadWholeFile(folder.path() / "surface.stl", kMostExportBytes);
    Add(kExportFiles[3], std::move(object));
  }

  void AddRegistration() {
    if (!result_.alignment || result_.verdict == Verdict::kNoAnswer) {
      made_.left_out.push_back(say::dicom::NoRegistration());
      return;
    }
    DicomExport object = Common(DicomExportKind::kRegistration, say::dicom::TitleRegistration());
    object.frame_uid = reference_.planning ? reference_.planning->frame_of_reference_uid
                                           : UidOfDigest(reference_frame_);
    object.moving_frame_uid = UidOfDigest(current_frame_);
    object.T_frame_moving_mm = ReferenceFromSurface_mm(result_);
    Add(kExportFiles[4], std::move(object));
  }

  const ResultExportRequest& request_;
  const Catalogue& language_;
  StoredResult result_;
  Scene reference_, current_;
  std::string reference_frame_, current_frame_;
  std::time_t now_;
  std::string study_, code_;
  std::vector<cv::Mat> pictures_;
  ResultExport made_;
};

}  // namespace

OutputKind DicomExportOutput() {
  return {.name = say::output::DicomExport(),
          .marker_file = kExportFiles.front(),
          .known_entries = {kExportFiles.begin(), kExportFiles.end()}};
}

Eigen::Matrix4d ReferenceFromSurface_mm(const StoredResult& result) {
  if (!result.alignment) return Eigen::Matrix4d::Identity();
  Eigen::Matrix4d T_mm = result.alignment->T_reference_current;
  T_mm.topRightCorner<3, 1>() /= kMillimetre;
  if (!result.compared_with) return T_mm;
  const auto posture = PostureOfPosition(result.compared_with->posture);
  if (!posture) throw DataError(say::dicom::NotWritten(result.compared_with->posture));
  Eigen::Matrix4d T_lps_iec_mm = Eigen::Matrix4d::Identity();
  T_lps_iec_mm.topLeftCorner<3, 3>() = IecFromPatient(*posture).transpose();
  T_lps_iec_mm.topRightCorner<3, 1>() = result.compared_with->isocentre_lps_mm;
  return T_lps_iec_mm * T_mm;
}

ResultExport DescribeResultExport(const ResultExportRequest& request, const Catalogue& language) {
  return ExportMaker(request, language).Make();
}

void WriteResultExport(const ResultExport& exported, const fs::path& folder) {
  AtomicFolder output(folder, DicomExportOutput());
  for (const NamedExport& one : exported.objects)
    WriteDicomExport(one.object, output.path() / one.file_name);
  output.Commit();
}

}  // namespace plumb
