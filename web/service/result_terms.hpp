// Words that every presentation of a result shares: the page without script and the reports.
#pragma once

#include <array>
#include <string_view>

#include "algo/base/notice.hpp"
#include "web/service/scan_service.hpp"

namespace plumb::web {

/// Names of numbers that run along the axes of the reference marker.
struct AxisTerms {
  std::string_view head, left;          ///< Along the patient's axes.
  std::string_view marker_x, marker_y;  ///< Where those are not known.
};

struct ResultTerms {
  std::string_view notice;
  std::array<std::string_view, 6> axes;
  AxisTerms lines, tilts;                        ///< For shifts and rotations without a known room.
  std::string_view within, not_surely, outside;  ///< The assessment of one number.
  std::string_view no_answer;                    ///< As a verdict.
  std::string_view not_known, no_move, scan_again, insignificant;  ///< In place of a direction.
  std::string_view posture, as_reference;
  std::string_view overdue, check_failed;
  char decimal = '.';
};

inline constexpr ResultTerms kEnglishTerms = {
    .notice = kResearchNotice,
    .axes = {"Vertical", "Longitudinal", "Lateral", "Pitch", "Roll", "Yaw"},
    .lines = {.head = "Patient head/feet",
              .left = "Patient left/right",
              .marker_x = "Along marker X",
              .marker_y = "Along marker Y"},
    .tilts = {.head = "Tilt head/feet",
              .left = "Tilt left/right",
              .marker_x = "Tilt along marker X",
              .marker_y = "Tilt along marker Y"},
    .within = "in tolerance",
    .not_surely = "not surely within",
    .outside = "outside tolerance",
    .no_answer = "NO ANSWER",
    .not_known = "not known",
    .no_move = "no move needed",
    .scan_again = "scan again",
    .insignificant = "below its uncertainty",
    .posture = "Posture difference that remains after the shift",
    .as_reference = "every part as in the reference, within 3 mm",
    .overdue = "The daily check was overdue at this scan.",
    .check_failed = "The daily check had failed before this scan.",
    .decimal = '.'};

inline constexpr ResultTerms kSpanishTerms = {
    .notice =
        "Solo para investigación. No es un producto sanitario. No lo use para posicionar "
        "pacientes para un tratamiento ni para sustituir la guía por imagen.",
    .axes = {"Vertical", "Longitudinal", "Lateral", "Cabeceo", "Balanceo", "Guiñada"},
    .lines = {.head = "Paciente: cabeza/pies",
              .left = "Paciente: izq./der.",
              .marker_x = "Según X del marcador",
              .marker_y = "Según Y del marcador"},
    .tilts = {.head = "Inclinación cabeza/pies",
              .left = "Inclinación izq./der.",
              .marker_x = "Inclinación según X del marcador",
              .marker_y = "Inclinación según Y del marcador"},
    .within = "en tolerancia",
    .not_surely = "no concluyente",
    .outside = "fuera de tolerancia",
    .no_answer = "SIN RESPUESTA",
    .not_known = "no se conoce",
    .no_move = "no hay que mover",
    .scan_again = "escanear de nuevo",
    .insignificant = "menor que su incertidumbre",
    .posture = "Diferencia de postura que queda tras el desplazamiento",
    .as_reference = "todas las partes como en la referencia, dentro de 3 mm",
    .overdue = "El control diario estaba pendiente en este escaneo.",
    .check_failed = "El control diario anterior a este escaneo no se superó.",
    .decimal = ','};

/// Caution to show beside a result; empty if the check had passed.
constexpr std::string_view DailyCheckCaution(DailyCheck check, const ResultTerms& terms) {
  return check == DailyCheck::kFailed    ? terms.check_failed
         : check == DailyCheck::kOverdue ? terms.overdue
                                         : std::string_view();
}

}  // namespace plumb::web
