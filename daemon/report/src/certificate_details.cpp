#include "abbe/report/certificate_details.hpp"

#include <algorithm>
#include <charconv>
#include <chrono>

namespace abbe::daemon {
namespace {

/// The number in `digits`; -1 unless all characters are digits.
int number_of(std::string_view digits) {
  int number = -1;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  const bool whole = error == std::errc{} && end == digits.data() + digits.size();
  return whole && digits.front() != '-' ? number : -1;
}

}  // namespace

bool is_date(std::string_view text) {
  if (text.size() != 10 || text[4] != '-' || text[7] != '-') return false;
  const int year = number_of(text.substr(0, 4)), month = number_of(text.substr(5, 2)),
            day = number_of(text.substr(8, 2));
  if (year < 1 || month < 0 || day < 0) return false;  // the type xs:date has no year 0
  return std::chrono::year_month_day{std::chrono::year{year},
                                     std::chrono::month{static_cast<unsigned>(month)},
                                     std::chrono::day{static_cast<unsigned>(day)}}
      .ok();
}

bool is_country_code(std::string_view text) {
  return text.size() == 2 && std::ranges::all_of(text, [](char c) { return c >= 'A' && c <= 'Z'; });
}

bool is_used(const EquipmentDetails& equipment, EquipmentUse use) {
  const bool in_both = use == EquipmentUse::AsFound || use == EquipmentUse::AsLeft;
  return equipment.use == use || (in_both && equipment.use == EquipmentUse::Both);
}

}  // namespace abbe::daemon
