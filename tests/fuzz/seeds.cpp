// SPDX-License-Identifier: Apache-2.0
// Writes small good inputs for each fuzz target: plumb_fuzz_seeds FOLDER makes FOLDER/png,
// FOLDER/jpeg and so on.
#include <filesystem>
#include <opencv2/core.hpp>

#include "daemon/files/ply_file.hpp"
#include "daemon/files/stored_scene.hpp"
#include "daemon/files/trajectory_file.hpp"
#include "daemon/monitoring_files/monitoring_file.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "drivers/replay/tum_writer.hpp"
#include "tests/support/result_with.hpp"
#include "tests/unit/importers/bag_writer.hpp"
#include "tests/unit/importers/exr_writer.hpp"
#include "tests/unit/importers/mkv_writer.hpp"
#include "tests/unit/importers/ros2_writer.hpp"
#ifdef PLUMB_WITH_DICOM
#include "tests/unit/dicom/small_files.hpp"
#endif

namespace plumb {
namespace {

namespace fs = std::filesystem;

fs::path Folder(const fs::path& folder) {
  fs::create_directories(folder);
  return folder;
}

void WriteImages(const fs::path& root) {
  cv::Mat rgb(9, 11, CV_8UC3, cv::Scalar(10, 120, 250));
  rgb.at<cv::Vec3b>(4, 5) = cv::Vec3b(255, 0, 7);
  cv::Mat depth(9, 11, CV_16UC1, cv::Scalar(5000));
  depth.at<std::uint16_t>(3, 3) = 0;
  const fs::path png = Folder(root / "png");
  WritePng(png / "rgb", rgb);
  WritePng(png / "depth", depth);
  WritePng(png / "grey", cv::Mat(3, 2, CV_8UC1, cv::Scalar(9)));
  const fs::path jpeg = Folder(root / "jpeg");
  WriteWholeFile(jpeg / "fine", EncodeJpeg(rgb, 95));
  WriteWholeFile(jpeg / "coarse", EncodeJpeg(rgb, 5));
  const cv::Mat depth_m(20, 7, CV_32FC1, cv::Scalar(0.5));
  for (const std::uint8_t compression : {0, 1, 2, 3}) {
    const std::vector<std::uint8_t> file = testing::ExrFile(depth_m, {.compression = compression});
    WriteWholeFile(Folder(root / "exr") / std::to_string(compression), file);
  }
  WriteFloatTiff(Folder(root / "tiff") / "map", cv::Mat(5, 4, CV_32FC1, cv::Scalar(0.5)));
}

void WriteOni(const fs::path& root) {
  std::string file = "NI10" + std::string(20, '\0');
  const auto add = [&](std::uint32_t kind, std::uint32_t node,
                       const std::vector<std::uint32_t>& fields) {
    const auto size = static_cast<std::uint32_t>(28 + 4 * fields.size());
    for (const std::uint32_t number : {0x0052494eU, kind, node, size, 0U, 0U, 0U})
      file.append(reinterpret_cast<const char*>(&number), 4);
    for (const std::uint32_t number : fields)
      file.append(reinterpret_cast<const char*>(&number), 4);
  };
  add(13, 1, {4, 0x67616d49, 3});
  add(13, 2, {4, 0x74706544, 2});
  for (const std::uint32_t node : {1U, 2U}) add(10, node, {33333, 0, 1});
  add(11, 0, {});
  WriteWholeFile(Folder(root / "oni") / "small", file);
  WriteWholeFile(root / "oni/beside",
                 std::string_view("a: 1\ncolor_begin_us: 17\ndepth_begin_us: 18\n"));
}

#ifdef PLUMB_WITH_DICOM
void WriteDicom(const fs::path& root) {
  const auto [structures, plan] =
      SmallCt({.quirks = {simulated::CtQuirk::kPoints, simulated::CtQuirk::kHoles}});
  WriteWholeFile(Folder(root / "dicom") / "structures", std::string_view(DicomBytes(structures)));
  WriteWholeFile(root / "dicom/plan", std::string_view(DicomBytes(plan)));
  WriteWholeFile(root / "dicom/image", std::string_view(DicomBytes(SmallImages().front())));
}
#endif

void WriteRecorded(const fs::path& root) {
  testing::BagWriter bag(testing::BagWriter::Packing::kLz4);
  for (const bool is_depth : {true, false}) {
    const char* const topic =
        is_depth ? "/device_0/sensor_0/Depth_0" : "/device_0/sensor_1/Color_0";
    const char* const encoding = is_depth ? "mono16" : "rgb8";
    const int bytes = is_depth ? 2 : 3;
    const testing::BagStreamTruth stream = {
        .topic = topic, .width = 4, .height = 4, .encoding = encoding, .f = 4, .cx = 2, .cy = 2};
    bag.Camera(stream);
    bag.Pose(stream, {0.01, 0, 0});
    bag.Image(stream, std::string(static_cast<std::size_t>(16 * bytes), 'a'), 1.0, 1.0);
    bag.KeyValue(stream.topic + "/image/metadata", "Sensor Timestamp", "1000000", 1.0);
  }
  WriteWholeFile(Folder(root / "bag") / "lz4", bag.Finish());
  std::vector<testing::Ros2Message> ros2;
  for (const bool is_depth : {true, false}) {
    const std::string camera = is_depth ? "/c/depth/" : "/c/color/";
    const std::string pixels(is_depth ? 32 : 48, 'a');
    ros2.push_back({camera + "camera_info", "sensor_msgs/msg/CameraInfo",
                    testing::Ros2Camera(4, 2, 2, 4, 4, {0, 0, 0, 0, 0})});
    ros2.push_back({camera + "image_raw", "sensor_msgs/msg/Image",
                    testing::Ros2Image(1.0, camera, is_depth ? "16UC1" : "rgb8", 4, 4, pixels)});
  }
  ros2.push_back({"/tf_static", "tf2_msgs/msg/TFMessage",
                  testing::Ros2Transforms({{"/c/depth/", "/c/color/", 0.01, 0, 0}})});
  using testing::Container;
  for (const auto& [name, container] : {std::pair{"db3", Container::kDatabase},
                                        {"mcap", Container::kMcapPlain},
                                        {"mcap_lz4", Container::kMcapLz4},
                                        {"mcap_zstd", Container::kMcapZstd}})
    WriteWholeFile(root / "bag" / name, testing::InContainer(ros2, container));
  // Images of other sizes than stated: they are read last, and real ones are longer than inputs.
  testing::AzureTruth azure;
  azure.colors = azure.depths = {"any", "any"};
  WriteWholeFile(root / "bag" / "mkv", testing::MkvWriter::Write(azure));
  azure.groups = true;
  azure.known_sizes = false;
  WriteWholeFile(root / "bag" / "mkv_groups", testing::MkvWriter::Write(azure));
  const fs::path stream = Folder(root / "stream");
  const std::vector<std::string> texts = {
      R"({"fx": 600, "fy": 600, "cx": 320, "cy": 240, "depth_scale": 1000})",
      "Camera.fx: 517.3\nCamera.fy: 516.5\nCamera.cx: 318.6\nCamera.cy: 255.3\n",
      "585.5 0 320\n0 586 240\n0 0 1\n",
      R"({"protocol":"plumb stream","version":1,"serial":"a","camera":{"image_width":640,"image_height":480,"camera_matrix":[600,0,320,0,600,240,0,0,1],"distortion_coefficients":[0,0,0,0,0],"depth_scale":1000}})",
      "",
      R"({"K":[351,0,0,0,351,0,181,240,1],"w":360,"h":480,"fps":60,"frameTimestamps":[0,0.02]})",
      "338, 0, 179\n0, 338, 119\n0, 0, 1\n0.1, 000000, 0, 0, 0\n0.2, 000001, 0, 0, 0\n"};
  for (std::size_t i = 0; i < texts.size(); ++i)
    WriteWholeFile(stream / std::to_string(i), static_cast<char>(i) + texts[i]);
}

void WriteTexts(const fs::path& root) {
  StreamInfo info;
  info.room_markers.reference = 3;
  const std::string camera = CameraFileText(info, 5000);
  WriteWholeFile(Folder(root / "camera") / "registered", camera);
  info.depth_noise.constant_m = 0.003;
  WriteWholeFile(root / "camera/noisy", CameraFileText(info, 5000));
  std::string depth_camera = camera;
  depth_camera.replace(
      depth_camera.find("depth_registered: 1"), 19,
      "depth_registered: 0\ndepth_camera_matrix: [ 570., 0., 320., 0., 570., 240., 0., 0., 1. ]\n"
      "depth_distortion_coefficients: [ 0.1, 0., 0., 0., 0. ]\n"
      "T_color_depth: [ 1., 0., 0., 0.02, 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1. ]");
  WriteWholeFile(root / "camera/unregistered", depth_camera);
  info.intrinsics.distortion = {0.51, -2.74, 0.0006, -0.0002, 1.64, 0.39, -2.55, 1.56};
  WriteWholeFile(root / "camera/rational", CameraFileText(info, 5000));
  WriteWholeFile(root / "camera/equidistant",
                 "image_width: 640\nimage_height: 480\ndistortion_model: equidistant\n"
                 "camera_matrix: [ 600., 0., 320., 0., 600., 240., 0., 0., 1. ]\n"
                 "distortion_coefficients: [ -0.012, 0.031, -0.022, 0.004 ]\n");
  WriteWholeFile(
      Folder(root / "index") / "rgb",
      std::string_view("# c\n1.0 rgb/1.png\n1.033 rgb/2.png\r\n1305031102.175304 a b.png\n"));

  Scene scene;
  scene.frame = SceneFrame::kReferenceMarker;
  scene.room_markers.dictionary = "DICT_6X6_250";
  scene.room_markers.length_m = 0.104;
  scene.room_markers.reference = 5;
  scene.markers[5] = {CornersInMarkerFrame(0.104), 4, 0.001};
  scene.height_map.emplace(GridShape{0, 0, 0.0015, 4, 3});
  scene.keyframes = {{1.0, Pose::Identity()}, {2.0, Pose::Identity()}};
  scene.timings_s["mesh"] = 0.1;
  scene.warnings = {Message::Verbatim("w")};
  WriteWholeFile(Folder(root / "scene") / "scene", SceneJson(scene));
  WriteWholeFile(Folder(root / "trajectory") / "two", TrajectoryText(scene.keyframes));

  const fs::path control = Folder(root / "control");
  WriteWholeFile(control / "status", std::string_view(R"({"command":"status"})"));
  WriteWholeFile(control / "press", std::string_view(R"({"command":"press","long":true})"));
  WriteWholeFile(control / "sim", std::string_view(R"({"command":"sim","action":"next-scene"})"));
}

void WriteSurfaces(const fs::path& root) {
  PointCloud cloud;
  cloud.points = {{0, 0, 1}, {1, 0, 1}, {0, 1, 1}};
  cloud.normals = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}};
  cloud.colors = {Color{1, 2, 3}, Color{4, 5, 6}, Color{7, 8, 9}};
  fs::remove_all(root / "monitoring");
  MonitoringFileWriter record(Folder(root / "monitoring") / "01.plm", {{"scan", "000001"}});
  record.AddFrames(std::vector<MonitorLine>(3, {.since_zero = LiveNumbers{}, .visible = 0.9}));
  record.AddEvent({{"event", "ended"}});
  const fs::path ply = Folder(root / "ply");
  WriteCloudPly(ply / "cloud", cloud);
  WriteMeshPly(ply / "mesh", {cloud.points, {}, cloud.colors, {{0, 1, 2}}});
}

/// What browsers send; the first byte chooses the reader, as in web_fuzz.cpp.
void WriteWeb(const fs::path& root) {
  const fs::path web = Folder(root / "web");
  const std::string plan =
      R"({"region_m":[[0,0],[1,0],[1,1.5]],"isocentre_m":[0.1,0.2,0.3],"shift_tolerance_mm":3,"rotation_tolerance_deg":1,"posture":"HFS","couch_markers":false})";
  const std::string settings =
      R"({"shift_tolerance_mm":3,"rotation_tolerance_deg":1,"posture":"FFP","couch_markers":true,"auto_stop_s":10,"scan_limit_s":60,"keep_recordings":false,"retention_days":0,"idle_logout_min":15})";
  const std::vector<std::string> texts = {"name=a%2Bb&password=c+d",
                                          "p\xC3\xA4tient\n",
                                          "plumb_session=abc; b=2",
                                          "/api/v1/scans/s1/files/result.json",
                                          R"({"name":"anna","disabled":false})",
                                          plan,
                                          settings};
  for (std::size_t i = 0; i < texts.size(); ++i) {
    WriteWholeFile(web / std::to_string(i), static_cast<char>(i) + texts[i]);
  }
}

/// What else plumbd reads; the first byte chooses the reader, as in daemon_fuzz.cpp.
void WriteDaemon(const fs::path& root) {
  const fs::path daemon = Folder(root / "daemon");
  const std::vector<std::string> texts = {
      "[appliance]\nquota_gb = 3\n[button]\nline = \"start\"\n[web]\nlisten = \"0.0.0.0:8080\"\n",
      "[reconstruct]\nuse_row_motion = false\n[compare]\nmin_coverage = 0.8\n",
      R"({"format":1,"frame":"reference_marker","polygon_m":[[0,0],[1,0],[1,1]]})",
      R"({"format":"plumb sensor profile","version":1,"sweeps":1,"stated_intrinsics":{},"mean":[]})",
      testing::ResultWith(R"({"verdict":"move","reasons":["a"]})")};
  for (std::size_t i = 0; i < texts.size(); ++i)
    WriteWholeFile(daemon / std::to_string(i), static_cast<char>(i) + texts[i]);
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const std::filesystem::path root = argv[1];
  plumb::WriteImages(root);
  plumb::WriteOni(root);
  plumb::WriteRecorded(root);
#ifdef PLUMB_WITH_DICOM
  plumb::WriteDicom(root);
#endif
  plumb::WriteTexts(root);
  plumb::WriteWeb(root);
  plumb::WriteDaemon(root);
  plumb::WriteSurfaces(root);
  return 0;
}
