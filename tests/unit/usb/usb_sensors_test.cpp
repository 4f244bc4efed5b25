// SPDX-License-Identifier: Apache-2.0
// libusb itself on an emulated bus (umockdev).
#include "drivers/usb/usb_sensors.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <umockdev.h>

#include <array>
#include <string>

#include <fmt/format.h>

#include "tests/support/skip.hpp"
#include "tests/support/under_umockdev.hpp"

namespace plumb {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

constexpr std::array<unsigned char, 18> kHubDescriptor{0x12, 0x01, 0x00, 0x02, 0x09, 0x00,
                                                       0x01, 0x40, 0x6b, 0x1d, 0x02, 0x00,
                                                       0x01, 0x06, 0x03, 0x02, 0x01, 0x01};
// An Xtion Pro Live: device descriptor, one configuration with one interface of the vendor's own
// class.
std::string SensorDescriptors(unsigned char vendor_low, unsigned char product_low,
                              unsigned char product_high) {
  const std::array<unsigned char, 36> bytes{
      0x12, 0x01, 0x00, 0x02, 0x00, 0x00, 0x00, 0x40, vendor_low, 0x1d, product_low, product_high,
      0x01, 0x00, 0x02, 0x01, 0x00, 0x01, 9,    2,    18,         0,    1,           1,
      0,    0x80, 250,  9,    4,    0,    0,    0,    0xff,       0,    0,           0};
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

class UsbSensorsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!testing::UnderUmockdev())
      PLUMB_SKIP("not under umockdev: run it through ctest, or with umockdev-wrapper");
    testbed_ = umockdev_testbed_new();
    hub_ = umockdev_testbed_add_device(
        testbed_, "usb", "usb1", nullptr, "busnum", "1", "devnum", "1", "idVendor", "1d6b",
        "idProduct", "0002", "speed", "480", "bConfigurationValue", "1", "bDeviceClass", "09",
        nullptr, "DEVTYPE", "usb_device", "DEVNAME", "/dev/bus/usb/001/001", "BUSNUM", "001",
        "DEVNUM", "001", "MAJOR", "189", "MINOR", "0", nullptr);
    umockdev_testbed_set_attribute_binary(testbed_, hub_, "descriptors",
                                          const_cast<unsigned char*>(kHubDescriptor.data()),
                                          kHubDescriptor.size());
  }
  void TearDown() override {
    if (testbed_ != nullptr) g_object_unref(testbed_);
  }

  std::string Plug(int address, const char* speed = "480", unsigned char vendor_low = 0x27) {
    const std::string number = std::to_string(address), padded = fmt::format("{:03}", address);
    const std::string node = "/dev/bus/usb/001/" + padded;
    gchar* path = umockdev_testbed_add_device(
        testbed_, "usb", "1-1", hub_, "busnum", "1", "devnum", number.c_str(), "idVendor",
        vendor_low == 0x27 ? "1d27" : "1d50", "idProduct", "0601", "speed", speed,
        "bConfigurationValue", "1", "bDeviceClass", "00", nullptr, "DEVTYPE", "usb_device",
        "DEVNAME", node.c_str(), "BUSNUM", "001", "DEVNUM", padded.c_str(), "MAJOR", "189", "MINOR",
        "1", "PRODUCT", "1d27/601/1", "SUBSYSTEM", "usb", nullptr);
    EXPECT_NE(path, nullptr);
    const std::string descriptors = SensorDescriptors(vendor_low, 0x01, 0x06);
    umockdev_testbed_set_attribute_binary(
        testbed_, path, "descriptors",
        reinterpret_cast<unsigned char*>(const_cast<char*>(descriptors.data())),
        static_cast<gint>(descriptors.size()));
    umockdev_testbed_uevent(testbed_, path, "add");  // the first one came before the descriptors
    std::string result = path;
    g_free(path);
    return result;
  }
  void Unplug(const std::string& path) {
    umockdev_testbed_uevent(testbed_, path.c_str(), "remove");
    umockdev_testbed_remove_device(testbed_, path.c_str());
  }

  UMockdevTestbed* testbed_ = nullptr;
  gchar* hub_ = nullptr;
};

TEST_F(UsbSensorsTest, ListsWhatIsAttachedNow) {
  EXPECT_TRUE(ListUsbSensors().empty());
  for (int round = 0; round < 2; ++round) {
    const std::string path = Plug(2 + round);
    const std::vector<UsbSensor> sensors = ListUsbSensors();
    ASSERT_EQ(sensors.size(), 1U);
    EXPECT_EQ(sensors[0].address, 2 + round);
    EXPECT_EQ(sensors[0].model, "Xtion Pro Live");
    EXPECT_EQ(sensors[0].product, 0x0601);
    EXPECT_EQ(sensors[0].speed, "480 Mbit/s");
    Unplug(path);
    EXPECT_TRUE(ListUsbSensors().empty());
  }
}

TEST_F(UsbSensorsTest, ADeviceNodeThatCannotBeOpenedIsDiagnosed) {
  (void)Plug(2);  // its device node does not exist, so it cannot be opened
  const std::vector<UsbSensor> sensors = ListUsbSensors();
  ASSERT_EQ(sensors.size(), 1U);
  EXPECT_EQ(sensors[0].permitted, false);
  EXPECT_THAT(EnglishTexts(sensors[0].problems), Contains(HasSubstr("udev rule")));
}

TEST_F(UsbSensorsTest, ASlowPortIsDiagnosed) {
  (void)Plug(2, "12");
  const std::vector<UsbSensor> sensors = ListUsbSensors();
  ASSERT_EQ(sensors.size(), 1U);
  EXPECT_THAT(EnglishTexts(sensors[0].problems), Contains(HasSubstr("12 Mbit/s only")));
}

TEST_F(UsbSensorsTest, OtherDevicesAreNotSensors) {
  (void)Plug(2, "480", 0x50);
  EXPECT_TRUE(ListUsbSensors().empty());
}

TEST(UsbModelTest, NamesTheFamily) {
  EXPECT_EQ(UsbSensorModel(0x1d27, 0x0609), "Carmine");
  EXPECT_EQ(UsbSensorModel(0x1d27, 0x9999), "unknown PrimeSense device");
  EXPECT_EQ(UsbSensorModel(0x2bc5, 0x0401), "Orbbec device");
  EXPECT_EQ(UsbSensorModel(0x045e, 0x02ae), "Kinect for Xbox 360");
  EXPECT_FALSE(UsbSensorModel(0x045e, 0x0040));  // a mouse of the same maker
  EXPECT_FALSE(UsbSensorModel(0x1d6b, 0x0601));
}

TEST(UsbSensorModelTest, CamerasWithoutAnOpenNi2DriverAreNamedWithTheirMakersLibrary) {
  EXPECT_EQ(UsbSensorModel(0x8086, 0x0b07), "RealSense D435");
  EXPECT_EQ(DriverOf(0x8086, 0x0b07).name, "realsense");
  EXPECT_EQ(DriverOf(0x045e, 0x02ae).name, "freenect");
  EXPECT_EQ(DriverOf(0x2bc5, 0x066b).name, "orbbec") << "Femto Bolt";
  EXPECT_EQ(DriverOf(0x2bc5, 0x0401).name, "") << "an Astra, by its maker's driver for OpenNI2";
  EXPECT_EQ(DriverOf(0x1d27, 0x0601).name, "");
  EXPECT_EQ(SdkOf(0x8086, 0x0b07), "") << "there is a driver for it";
  EXPECT_EQ(SdkOf(0x045e, 0x097c), "libk4a");
  EXPECT_EQ(UsbSensorModel(0x8086, 0x1234), std::nullopt) << "Intel makes other devices, too";
  EXPECT_EQ(SdkOf(0x1d27, 0x0601), "");
  EXPECT_EQ(SdkOf(0x045e, 0x02ae), "");
}

}  // namespace
}  // namespace plumb
