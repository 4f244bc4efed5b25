#include "web/api/result_words.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>

namespace plumb::web {
namespace {

constexpr ResultWords kEnglish = {
    .terms = kEnglishTerms,
    .code = "en",
    .other = "Español",
    .other_code = "es",
    .title = "Plumb result",
    .notice_label = "Notice",
    .log_in = "Log in",
    .name = "Name",
    .password = "Password",
    .wrong_password = "Name or password is wrong.",
    .first_password =
        "Somebody else chose this password: log in once on the page with script, and change it.",
    .out_of_order = "Out of order",
    .nobody_can = "No one can log in or scan until this is fixed: {}",
    .none = "No result yet",
    .patient = "Patient {}",
    .no_patient = "No patient: unassigned scan",
    .scan_line = "Scan {} of {}, {}.",
    .fraction = "Fraction {}.",
    .ago_min = "{} min ago",
    .ago_unknown = "at an unknown time: the clock has stepped",
    .old = "OLD: do not act on it.",
    .running = "<strong>A new scan is running.</strong> What follows is no longer valid.",
    .newer_failed =
        "<strong>NO ANSWER</strong> from the last scan, of {}: {} What follows is from before it.",
    .accepted_by = "Accepted by {}.",
    .accepted_outside = "Accepted outside tolerance by {}: {}",
    .accepted_unsure = "Accepted although not surely within tolerance by {}: {}",
    .reference_line = "Reference version {} of {}, approved by {}.",
    .no_reference = "No comparison: this scan has no reference.",
    .in_tolerance = {"IN TOLERANCE", "WAS IN TOLERANCE"},
    .unsure = {"NOT SURELY WITHIN", "WAS NOT SURELY WITHIN"},
    .move = {"MOVE", "WAS OUTSIDE TOLERANCE"},
    .heads = {"Axis", "Value", "95 %", "Tolerance", "Assessment", "Direction"},
    .no_change = "no change",
    .to_apply = "Correction to apply at the isocentre",
    .found_then = "Correction found then, at the isocentre: not to be applied now",
    .remaining = "Remaining difference at the isocentre: no move needed",
    .remained_then = "Difference that remained then, at the isocentre",
    .measured = "Measured difference at the isocentre",
    .measured_then = "Difference measured then, at the isocentre",
    .where = "Where on the body",
    .now = "Before the correction",
    .map = "Map of height errors, current minus reference",
    .overlay = "Overlay: reference blue, current red"};

constexpr ResultWords kSpanish = {
    .terms = kSpanishTerms,
    .code = "es",
    .other = "English",
    .other_code = "en",
    .title = "Resultado de Plumb",
    .notice_label = "Aviso",
    .log_in = "Iniciar sesión",
    .name = "Nombre",
    .password = "Contraseña",
    .wrong_password = "Nombre o contraseña incorrectos.",
    .first_password =
        "Otra persona eligió esta contraseña: inicie sesión una vez en la página con script y "
        "cámbiela.",
    .out_of_order = "Fuera de servicio",
    .nobody_can = "Nadie puede iniciar sesión ni escanear hasta que se corrija esto: {}",
    .none = "Todavía no hay resultados",
    .patient = "Paciente {}",
    .no_patient = "Sin paciente: escaneo sin asignar",
    .scan_line = "Escaneo {} del {}, {}.",
    .fraction = "Fracción {}.",
    .ago_min = "hace {} min",
    .ago_unknown = "en un momento desconocido: el reloj ha saltado",
    .old = "ANTIGUO: no actúe según él.",
    .running = "<strong>Hay un nuevo escaneo en curso.</strong> Lo que sigue ya no es válido.",
    .newer_failed =
        "El último escaneo, del {}, quedó <strong>SIN RESPUESTA</strong>: {} Lo que sigue es "
        "anterior.",
    .accepted_by = "Aceptado por {}.",
    .accepted_outside = "Aceptado fuera de tolerancia por {}: {}",
    .accepted_unsure = "Aceptado, aunque no es concluyente, por {}: {}",
    .reference_line = "Referencia, versión {} del {}, aprobada por {}.",
    .no_reference = "Sin comparación: este escaneo no tiene referencia.",
    .in_tolerance = {"EN TOLERANCIA", "ESTABA EN TOLERANCIA"},
    .unsure = {"NO CONCLUYENTE", "NO ERA CONCLUYENTE"},
    .move = {"MOVER", "ESTABA FUERA DE TOLERANCIA"},
    .heads = {"Eje", "Valor", "95 %", "Tolerancia", "Evaluación", "Dirección"},
    .no_change = "sin cambio",
    .to_apply = "Corrección que aplicar, en el isocentro",
    .found_then = "Corrección hallada entonces, en el isocentro: no la aplique ahora",
    .remaining = "Diferencia restante en el isocentro: no hay que mover",
    .remained_then = "Diferencia que quedaba entonces, en el isocentro",
    .measured = "Diferencia medida en el isocentro",
    .measured_then = "Diferencia medida entonces, en el isocentro",
    .where = "En qué parte del cuerpo",
    .now = "Antes de la corrección",
    .map = "Mapa de errores de altura: actual menos referencia",
    .overlay = "Superposición: referencia en azul, actual en rojo"};

std::string_view Trimmed(std::string_view text) {
  const auto is_space = [](char c) { return c == ' ' || c == '\t'; };
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  return text;
}

/// The weight of one entry of the header, as "es-MX;q=0.8".
double WeightOf(std::string_view entry) {
  const std::size_t mark = entry.find(";q=");
  if (mark == std::string_view::npos) return 1.0;
  const std::string_view number = Trimmed(entry.substr(mark + 3));
  double weight = 0.0;
  const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), weight);
  return error == std::errc{} && end == number.data() + number.size() ? weight : 0.0;
}

/// True for "es", "es-MX" and "ES;q=0.3".
bool Names(std::string_view entry, std::string_view language) {
  if (entry.size() < language.size()) return false;
  const bool begins =
      std::equal(language.begin(), language.end(), entry.begin(), [](char a, char b) {
        return a == static_cast<char>(std::tolower(static_cast<unsigned char>(b)));
      });
  const char next = entry.size() == language.size() ? ';' : entry[language.size()];
  return begins && (next == '-' || next == ';' || next == ' ');
}

}  // namespace

const ResultWords& ResultWordsOf(Language language) {
  return language == Language::kSpanish ? kSpanish : kEnglish;
}

Language PreferredLanguage(std::string_view accept_language) {
  double english = 0.0, spanish = 0.0;
  while (!accept_language.empty()) {
    const std::size_t comma = std::min(accept_language.find(','), accept_language.size());
    const std::string_view entry = Trimmed(accept_language.substr(0, comma));
    accept_language.remove_prefix(std::min(comma + 1, accept_language.size()));
    if (Names(entry, "en")) english = std::max(english, WeightOf(entry));
    if (Names(entry, "es")) spanish = std::max(spanish, WeightOf(entry));
  }
  return spanish > english ? Language::kSpanish : Language::kEnglish;
}

}  // namespace plumb::web
