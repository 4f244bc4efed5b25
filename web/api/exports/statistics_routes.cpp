// SPDX-License-Identifier: Apache-2.0
// Set-up statistics over the fractions of a patient and over the patients of a site.
#include <algorithm>
#include <chrono>
#include <iterator>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "algo/base/ascii_lower.hpp"
#include "web/api/all_routes.hpp"
#include "web/exchange/csv.hpp"
#include "web/exchange/json.hpp"
#include "web/model/course_statistics.hpp"
#include "words/store.hpp"

namespace plumb::web {
namespace {

constexpr int kMaxScansOfCourse = 1000;
constexpr std::size_t kMaxCourses = 500;
constexpr auto kMostTime = std::chrono::seconds(5);

/// Of a patient against one reference.
struct Course {
  Patient patient;
  int version = 0;  ///< Of the reference; 0: there is none.
  CourseStatistics statistics;
};

std::vector<Course> CoursesOf(const Patient& patient, const Services& services) {
  std::vector<Course> courses;
  for (CoursePart& part : PartsOf(services.scans.Scans(patient.id, kMaxScansOfCourse))) {
    const auto reference = services.references.FindReference(part.reference_id);
    courses.push_back({patient, reference ? reference->version : 0, std::move(part.statistics)});
  }
  return courses;
}
/// The courses with an answer, newest first, and how many were not read for want of time.
struct Courses {
  std::vector<Course> all;
  std::size_t left_out = 0;
};

Courses ReadCourses(const Services& services) {
  std::vector<Patient> listed = services.patients.Patients();
  std::erase_if(listed, [](const Patient& patient) { return patient.num_scans == 0; });
  std::ranges::stable_sort(listed, std::ranges::greater(), &Patient::created_at);
  const auto begun = std::chrono::steady_clock::now();
  Courses courses;
  for (std::size_t i = 0; i < listed.size(); ++i) {
    if (i == kMaxCourses || std::chrono::steady_clock::now() - begun > kMostTime) {
      courses.left_out = listed.size() - i;
      break;
    }
    std::ranges::move(CoursesOf(listed[i], services), std::back_inserter(courses.all));
  }
  return courses;
}

using Which = std::pair<const char*, NumberSpreads CourseStatistics::*>;
constexpr std::array<Which, 2> kWhich = {Which{"first", &CourseStatistics::first},
                                         Which{"last", &CourseStatistics::last}};

/// Of each site, whose letter case does not count: its name and its courses.
std::map<std::string, std::pair<std::string, std::vector<CourseStatistics>>> BySite(
    const std::vector<Course>& courses) {
  std::map<std::string, std::pair<std::string, std::vector<CourseStatistics>>> sites;
  for (const Course& course : courses) {
    auto& [name, of_site] = sites[AsciiLower(course.patient.site)];
    if (name.empty()) name = course.patient.site;
    of_site.push_back(course.statistics);
  }
  return sites;
}

Json CourseJson(const Course& of) {
  const auto& [patient, version, course] = of;
  Json json = {{"patient_id", patient.id},
               {"code", patient.code},
               {"site", patient.site},
               {"reference_version", version > 0 ? Json(version) : Json(nullptr)},
               {"fractions", course.fractions},
               {"scans", course.scans},
               {"accepted", course.accepted},
               {"overrides", course.overrides},
               {"minutes", course.minutes},
               {"numbers", Json::array()}};
  for (std::size_t i = 0; i < kNumberAxes.size(); ++i) {
    Json number = {{"name", kNumberAxes[i].name}, {"unit", kNumberAxes[i].symbol()}};
    for (const auto& [name, which] : kWhich) {
      const NumberSpread& spread = (course.*which).at(i);
      number[name] = {{"count", spread.count},
                      {"mean", spread.count > 0 ? Json(spread.mean) : Json(nullptr)},
                      {"deviation", spread.deviation}};
    }
    json["numbers"].push_back(std::move(number));
  }
  return json;
}

Json SiteJson(const std::string& site, const std::vector<CourseStatistics>& courses) {
  Json json = {{"site", site}, {"courses", courses.size()}, {"numbers", Json::array()}};
  for (std::size_t i = 0; i < kNumberAxes.size(); ++i) {
    Json number = {{"name", kNumberAxes[i].name}, {"unit", kNumberAxes[i].symbol()}};
    for (const auto& [name, which] : kWhich) {
      const GroupSpread spread = GroupSpreadOf(courses, which, i);
      number[name] = {{"courses", spread.courses},
                      {"mean", spread.courses > 0 ? Json(spread.mean) : Json(nullptr)},
                      {"systematic", spread.systematic},
                      {"random", spread.random}};
    }
    json["numbers"].push_back(std::move(number));
  }
  return json;
}

Json StatisticsJson(const Courses& courses) {
  Json json = {
      {"courses", Json::array()}, {"sites", Json::array()}, {"left_out", courses.left_out}};
  for (const Course& course : courses.all) json["courses"].push_back(CourseJson(course));
  for (const auto& [key, site] : BySite(courses.all))
    json["sites"].push_back(SiteJson(site.first, site.second));
  return json;
}

/// A line for each course, then one for each site: there the deviation is the systematic error.
std::string StatisticsCsv(const Courses& courses, const Catalogue& language) {
  CsvTable table(language);
  for (const char* name : {"kind", "site", "patient", "reference", "courses", "fractions", "scans",
                           "accepted", "overrides", "minutes"})
    table.Plain(name);
  for (const auto& [name, which] : kWhich)
    for (const NumberAxis& axis : kNumberAxes)
      for (const char* what : {"mean", "deviation", "random"})
        table.Plain(fmt::format("{}_{}_{}", name, what, axis.key));
  table.EndRow();
  for (const auto& [patient, version, course] : courses.all) {
    table.Plain("course").Text(patient.site).Text(patient.code);
    for (const auto count :
         {version, 1, course.fractions, course.scans, course.accepted, course.overrides})
      table.Plain(std::to_string(count));
    table.Number(course.minutes);
    for (const auto& [name, which] : kWhich)
      for (const NumberSpread& spread : course.*which)
        table.Number(spread.count > 0 ? std::optional(spread.mean) : std::nullopt)
            .Number(spread.deviation)
            .Empty();
    table.EndRow();
  }
  for (const auto& [key, site] : BySite(courses.all)) {
    table.Plain("site").Text(site.first).Empty().Empty().Plain(std::to_string(site.second.size()));
    for (int i = 0; i < 5; ++i) table.Empty();
    for (const auto& [name, which] : kWhich) {
      for (std::size_t i = 0; i < kNumberAxes.size(); ++i) {
        const GroupSpread spread = GroupSpreadOf(site.second, which, i);
        table.Number(spread.courses > 0 ? std::optional(spread.mean) : std::nullopt)
            .Number(spread.systematic)
            .Number(spread.random);
      }
    }
    table.EndRow();
  }
  return table.Take();
}

}  // namespace

void AddStatisticsRoutes(Routes& routes, const Services& services) {
  routes
      .ReadInBackground("/api/v1/patients/{id}/statistics", Permission::kView,
                        [services](const Request& request) {
                          const auto patient = services.patients.FindPatient(request.arguments[0]);
                          if (!patient) return ErrorResponse(404, say::store::NoPatient());
                          Json courses = Json::array();
                          for (const Course& course : CoursesOf(*patient, services))
                            courses.push_back(CourseJson(course));
                          return JsonResponse({{"courses", courses}});
                        })
      .Discloses("view.patient");
  routes
      .ReadInBackground("/api/v1/statistics", Permission::kView,
                        [services](const Request&) {
                          return JsonResponse(StatisticsJson(ReadCourses(services)));
                        })
      .Discloses("view.statistics");
  routes
      .ReadInBackground("/api/v1/statistics.csv", Permission::kView,
                        [services](const Request& request) {
                          return Download("text/csv; charset=utf-8",
                                          StatisticsCsv(ReadCourses(services), LanguageIn(request)),
                                          "plumb_statistics.csv");
                        })
      .Discloses("", "download.statistics");
}

}  // namespace plumb::web
