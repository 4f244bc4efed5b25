#include "daemon/appliance/report_words.hpp"

#include <algorithm>
#include <optional>
#include <regex>
#include <vector>

#include "algo/base/notice.hpp"
#include "web/assets/assets.hpp"

namespace plumb {
namespace {

constexpr ReportWords kEnglish = {
    .notice = kResearchNotice,
    .page = "Page {}",
    .scan_title = "Scan report",
    .course_title = "Course of {}",
    .patient = "Patient",
    .unassigned = "none (unassigned)",
    .site = "Site",
    .fraction = "Fraction",
    .scan = "Scan",
    .scans = "Scans",
    .reference = "Reference",
    .version = "version {}, {}",
    .plan = "Plan",
    .region = "Region",
    .corners = "{} corners, {:.0f} cm\u00b2",
    .whole_body = "the whole body",
    .isocentre = "Isocentre",
    .middle = "the middle of the region",
    .planned_by = "Planned by",
    .approved_by = "Approved by",
    .not_approved = "not approved",
    .checksum = "Checksum",
    .accepted = "Accepted",
    .accepted_by = "by {}",
    .accepted_outside = "outside tolerance by {}: {}",
    .no = "no",
    .printed = "Plumb {}, printed {}",
    .room_markers = "markers fixed to the room",
    .couch_markers = "markers fixed to the couch",
    .tolerance = "tolerance \u00b1{}{}",
    .tolerance_fact = "Tolerance",
    .postures = {"head first, supine", "head first, prone", "feet first, supine",
                 "feet first, prone"},
    .axes = {"Vertical", "Longitudinal", "Lateral", "Pitch", "Roll", "Yaw"},
    .short_axes = {"Vert. mm", "Long. mm", "Lat. mm", "Pitch \u00b0", "Roll \u00b0", "Yaw \u00b0"},
    .within = "in tolerance",
    .unsure = "not surely within",
    .outside = "outside tolerance",
    .not_known = "not known",
    .no_move = "no move needed",
    .insignificant = "below its uncertainty",
    .verdict_reference = "REFERENCE",
    .verdict_none = "NO RESULT",
    .verdict_in = "IN TOLERANCE",
    .verdict_unsure = "NOT SURELY WITHIN",
    .verdict_move = "MOVE",
    .verdict_no_answer = "NO ANSWER",
    .why_in = "Every value, with its uncertainty, is within tolerance.",
    .why_unsure = "Every value is within tolerance, but not with its uncertainty.",
    .why_move = "The correction below was to be applied.",
    .posture = "Posture difference that remains after the shift",
    .as_reference = "every part as in the reference, within 3 mm",
    .quality = "Scan quality",
    .markers = "Markers matched",
    .misfit = "Marker misfit",
    .covered = "Region covered",
    .hole = "Largest hole",
    .tracked = "Frames tracked",
    .tracked_of = "{} of {}",
    .lost = "Frames lost",
    .keyframes = "Keyframes",
    .sensor_on = "Sensor on for",
    .frames_lost = "{:.0f} % of the frames were lost.",
    .warming = "The sensor was still warming up.",
    .overdue = "The daily check was overdue at this scan.",
    .overdue_mark = "* Daily check",
    .overdue_words = "overdue at this scan",
    .when = "When",
    .verdict = "Verdict",
    .digits_note =
        "Each number with its uncertainty of 95 %, in the digits that it lets them have.",
    .sides = {"HEAD", "FEET", "LEFT", "RIGHT"},
    .pictures = {},
    .decimal = '.'};

constexpr ReportWords kSpanish = {
    .notice =
        "Solo para investigación. No es un producto sanitario. No lo use para posicionar "
        "pacientes para un tratamiento ni para sustituir la guía por imagen.",
    .page = "Página {}",
    .scan_title = "Informe del escaneo",
    .course_title = "Tratamiento de {}",
    .patient = "Paciente",
    .unassigned = "ninguno (sin asignar)",
    .site = "Localización",
    .fraction = "Fracción",
    .scan = "Escaneo",
    .scans = "Escaneos",
    .reference = "Referencia",
    .version = "versión {}, {}",
    .plan = "Plan",
    .region = "Región",
    .corners = "{} vértices, {:.0f} cm\u00b2",
    .whole_body = "todo el cuerpo",
    .isocentre = "Isocentro",
    .middle = "el centro de la región",
    .planned_by = "Planificado por",
    .approved_by = "Aprobado por",
    .not_approved = "sin aprobar",
    .checksum = "Suma de control",
    .accepted = "Aceptado",
    .accepted_by = "por {}",
    .accepted_outside = "fuera de tolerancia por {}: {}",
    .no = "no",
    .printed = "Plumb {}, impreso {}",
    .room_markers = "marcadores fijos a la sala",
    .couch_markers = "marcadores fijos a la camilla",
    .tolerance = "tolerancia \u00b1{}{}",
    .tolerance_fact = "Tolerancia",
    .postures = {"cabeza primero, supino", "cabeza primero, prono", "pies primero, supino",
                 "pies primero, prono"},
    .axes = {"Vertical", "Longitudinal", "Lateral", "Cabeceo", "Balanceo", "Guiñada"},
    .short_axes = {"Vert. mm", "Long. mm", "Lat. mm", "Cabeceo \u00b0", "Balanceo \u00b0",
                   "Guiñada \u00b0"},
    .within = "en tolerancia",
    .unsure = "no concluyente",
    .outside = "fuera de tolerancia",
    .not_known = "no se conoce",
    .no_move = "no hay que mover",
    .insignificant = "menor que su incertidumbre",
    .verdict_reference = "REFERENCIA",
    .verdict_none = "SIN RESULTADO",
    .verdict_in = "EN TOLERANCIA",
    .verdict_unsure = "NO CONCLUYENTE",
    .verdict_move = "MOVER",
    .verdict_no_answer = "SIN RESPUESTA",
    .why_in = "Todos los valores, con su incertidumbre, están en tolerancia.",
    .why_unsure = "Todos los valores están en tolerancia, pero no con su incertidumbre.",
    .why_move = "Había que aplicar la corrección siguiente.",
    .posture = "Diferencia de postura que queda tras el desplazamiento",
    .as_reference = "todas las partes como en la referencia, dentro de 3 mm",
    .quality = "Calidad del escaneo",
    .markers = "Marcadores",
    .misfit = "Desajuste",
    .covered = "Región cubierta",
    .hole = "Hueco mayor",
    .tracked = "Img. seguidas",
    .tracked_of = "{} de {}",
    .lost = "Img. perdidas",
    .keyframes = "Img. clave",
    .sensor_on = "Sensor encendido",
    .frames_lost = "Se perdió el {:.0f} % de las imágenes.",
    .warming = "El sensor aún se calentaba.",
    .overdue = "El control diario estaba pendiente en este escaneo.",
    .overdue_mark = "* Control diario",
    .overdue_words = "pendiente en este escaneo",
    .when = "Cuándo",
    .verdict = "Veredicto",
    .digits_note = "Cada número con su incertidumbre del 95 %, con las cifras que ella permite.",
    .sides = {"CABEZA", "PIES", "IZQUIERDA", "DERECHA"},
    .pictures = {.notice = "Solo para investigación. No es un producto sanitario. No lo use para "
                           "posicionar pacientes para un tratamiento ni para sustituir la guía por "
                           "imagen.",
                 .x_axis = "x (m), sistema del marcador de referencia",
                 .y_axis = "y (m)",
                 .error_title = "Error de altura: actual \u2212 referencia",
                 .overlay_title = "Superposición: referencia en azul, actual en rojo",
                 .height_title = "Alturas de la referencia",
                 .error = "error de altura",
                 .absolute_error = "|error de altura|",
                 .millimetres = "en milímetros",
                 .centimetres = "en centímetros",
                 .higher = "el actual está más alto",
                 .lower = "el actual está más bajo",
                 .tolerance = "tolerancia",
                 .not_in_both = "no medido en ambos escaneos",
                 .not_in_either = "no medido en ninguno de los escaneos",
                 .not_measured = "no medido",
                 .outlined = "delimitada: la región; más pálido fuera",
                 .surface_on_top = "superficie superior",
                 .reference = "referencia",
                 .current = "actual",
                 .both_within = "ambas, a menos de {} mm",
                 .height = "altura",
                 .isocentre = "isocentro",
                 .decimal = ','},
    .decimal = ','};

/// A reason is one sentence; longer texts are not translated, because the library's search
/// recurses.
constexpr std::size_t kMaxText = 400;

using Patterns = std::vector<std::pair<std::regex, std::string_view>>;
const Patterns& Compiled() {
  static const Patterns patterns = [] {
    Patterns made;
    for (const web::Phrase& phrase : web::SpanishPatterns())
      made.emplace_back(std::regex(std::string(phrase.text)), phrase.words);
    return made;
  }();
  return patterns;
}

std::optional<std::string> InSpanish(const std::string& text) {
  if (text.empty() || text.size() > kMaxText) return std::nullopt;
  const auto phrases = web::SpanishPhrases();
  const auto found = std::find_if(phrases.begin(), phrases.end(),
                                  [&](const web::Phrase& phrase) { return phrase.text == text; });
  if (found != phrases.end()) return std::string(found->words);
  static const std::regex number(R"(^[+-]?\d+\.\d+$)");
  if (std::regex_match(text, number)) {
    std::string comma = text;
    std::replace(comma.begin(), comma.end(), '.', ',');
    return comma;
  }
  for (const auto& [pattern, words] : Compiled()) {
    std::smatch match;
    if (!std::regex_match(text, match, pattern)) continue;
    std::string said;
    for (std::size_t i = 0; i < words.size(); ++i) {
      if (words[i] != '$' || i + 1 == words.size()) {
        said += words[i];
        continue;
      }
      const std::string part = match.str(static_cast<std::size_t>(words[++i] - '0'));
      said += InSpanish(part).value_or(part);
    }
    return said;
  }
  return std::nullopt;
}

}  // namespace

const ReportWords& WordsOf(web::Language language) {
  return language == web::Language::kSpanish ? kSpanish : kEnglish;
}

std::string Translated(const std::string& text, web::Language language) {
  if (language == web::Language::kEnglish) return text;
  return InSpanish(text).value_or(text);
}

}  // namespace plumb
