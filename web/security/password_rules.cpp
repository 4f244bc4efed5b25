// SPDX-License-Identifier: Apache-2.0
#include "web/security/password_rules.hpp"

#include <algorithm>
#include <array>
#include <cctype>

#include "algo/base/ascii_lower.hpp"
#include "words/web.hpp"

namespace plumb::web {
namespace {

/// Common passwords, including those typical of a hospital; lower case, sorted.
constexpr auto kCommon = std::to_array<std::string_view>({
    // clang-format off
    "0000000000", "0123456789", "01234567890", "0987654321", "1029384756", "1111111111",
    "1122334455", "112233445566", "121212121212", "123123123", "123321123321", "1234512345",
    "123454321", "123456123456", "12345678", "123456789", "1234567890", "12345678910",
    "131313131313", "147258369", "159357", "159753", "1a2b3c4d5e", "1q2w3e4r", "1q2w3e4r5t",
    "1q2w3e4r5t6y", "1qaz2wsx", "1qaz2wsx3edc", "2718281828", "3141592653", "31415926535",
    "5555555555", "6969696969", "741852963", "7777777777", "789456123", "987654321",
    "9876543210", "a1b2c3d4e5", "a1s2d3f4g5", "aa12345678", "abc123abc", "abcd1234abcd",
    "abcdefgh", "abcdefghij", "abcdefghijk", "abcdefghijkl", "access", "accessgranted",
    "accuray", "admin", "adminadmin", "administrador", "administrator", "alexander", "alexandra",
    "april", "arsenal", "asdasdasd", "asdfgh", "asdfghjkl", "asdfghjklo", "august", "autumn",
    "azerty", "azertyuiop", "barcelona", "baseball", "basketball", "batman", "benjamin",
    "bienvenido", "bienvenue", "brainlab", "butterfly", "change", "changeit", "changeme",
    "changemenow", "charlotte", "cheesecake", "chelsea", "chocolate", "christian", "christopher",
    "clinic", "clinica", "computer", "contrasena", "contrasenya", "correcthorsebatterystaple",
    "debian", "debianlinux", "december", "default", "doctor", "doctordoctor", "dragon", "elekta",
    "elizabeth", "engineer", "engineering", "facebook", "familyfirst", "february", "football",
    "forever", "freedom", "friday", "friends", "gantry", "garfield", "goodbye", "goodmorning",
    "google", "guest", "guestguest", "hello", "hellohello", "helloworld", "hospital",
    "hospitals", "iloveme", "ilovemyself", "iloveu", "iloveyou", "iloveyoubaby",
    "iloveyousomuch", "instagram", "internet", "isocenter", "isocentre", "january", "jennifer",
    "jessica", "july", "june", "juventus", "katherine", "kennwort", "klinik", "krankenhaus",
    "letmein", "letmeinnow", "letmeinplease", "linac", "linaclinac", "linkedin", "linux",
    "liverpool", "liverpoolfc", "lkjhgfdsa", "loremipsum", "macintosh", "manchester",
    "manchesterunited", "march", "master", "medical", "medicine", "michael", "michelle",
    "mickeymouse", "microsoft", "mnbvcxz", "monday", "monkey", "motdepasse", "mypass",
    "mypassword", "newpassword", "nicholas", "nopasswd", "nopassword", "nothing", "november",
    "nurse", "nursenurse", "october", "oncologia", "oncology", "onkologie", "opensesame",
    "operator", "operators", "p@ssw0rd", "p@ssword", "pa55w0rd", "pa55word", "parola",
    "passphrase", "passw0rd", "password", "password1password", "passwords", "passwort",
    "passwort1passwort", "patient", "patients", "physicians", "physicist", "plumb", "plumbline",
    "plumbplumb", "poiuytrewq", "pokemon", "princess", "princesse", "q1w2e3r4", "q1w2e3r4t5",
    "qazwsx", "qazwsxedc", "qazwsxedcrfv", "qweasd", "qweasdzxc", "qweqweqwe", "qwerty",
    "qwertyqwerty", "qwertyuiop", "qwertyuiopas", "qwertz", "qwertzuiop", "qwertzuiopu",
    "radiologie", "radiology", "radioterapia", "radiotherapie", "radiotherapy", "raspberry",
    "raspberrypi", "realmadrid", "root", "rootroot", "samantha", "samsung", "saturday",
    "scanner", "scannerscan", "secret", "secretsecret", "senha", "september", "shadow",
    "siemens", "snoopy", "spiderman", "spring", "starwars", "stephanie", "strahlentherapie",
    "strawberry", "summer", "summertime", "sunday", "sunshine", "superadmin", "superman",
    "superuser", "sysadmin", "technician", "temp", "temporary", "temppass", "temppassword",
    "test", "tester", "testing", "testing123testing", "testtest", "testtesttest", "thepassword",
    "thequickbrownfox", "thursday", "toor", "topsecret", "treatment", "treatmentroom", "trustno",
    "trustnoone", "tuesday", "ubuntu", "varian", "volleyball", "wednesday", "welcome",
    "welcomeback", "welcometo", "whatever", "willkommen", "windows", "winter", "wintertime",
    "yourpassword", "youtube", "yxcvbnm", "zaq12wsx", "zaq1xsw2", "zxcvbnm", "zxcvbnmasdfghjkl"
    // clang-format on
});
static_assert(std::is_sorted(kCommon.begin(), kCommon.end()));

bool IsCommon(std::string_view text) {
  return std::binary_search(kCommon.begin(), kCommon.end(), text);
}

bool IsLetter(char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; }

/// Without trailing digits and signs, which people append when they are required. Bytes above 127
/// belong to letters.
std::string_view WithoutTail(std::string_view text) {
  while (!text.empty() && !IsLetter(text.back()) && static_cast<unsigned char>(text.back()) < 128)
    text.remove_suffix(1);
  return text;
}

/// True if it repeats one piece of at most four bytes.
bool IsRepetition(std::string_view text) {
  for (std::size_t period = 1; period <= 4; ++period) {
    bool repeats = true;
    for (std::size_t i = period; i < text.size() && repeats; ++i)
      repeats = text[i] == text[i - period];
    if (repeats) return true;
  }
  return false;
}

}  // namespace

Message WhyNotPassword(std::string_view password, std::string_view user) {
  if (password.size() < kMinPassword || password.size() > kMaxPassword)
    return say::web::PasswordLength(kMinPassword, kMaxPassword);
  const std::string small = AsciiLower(password), name = AsciiLower(user);
  const std::string_view core = WithoutTail(small);
  if (IsCommon(small) || IsCommon(core)) return say::web::PasswordCommon();
  const bool is_name =
      small == name || small == name + name || (!core.empty() && core == WithoutTail(name));
  if (!name.empty() && is_name) return say::web::PasswordIsName();
  if (IsRepetition(small)) return say::web::PasswordRepeats();
  return {};
}

}  // namespace plumb::web
