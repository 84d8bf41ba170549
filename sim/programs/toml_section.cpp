#include "toml_section.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "abbe/protocol/table/faults.hpp"
#include "abbe/protocol/toml_nesting.hpp"
#include "abbe/result/try.hpp"
#include "abbe/sim/sim_clock.hpp"
#include "files.hpp"

namespace abbe::sim {
namespace {

constexpr std::size_t kMostFaults = 20;
constexpr std::int64_t kLastPort = 65535;

}  // namespace

void TomlFaults::add(const toml::node* where, std::string_view key, std::string_view what) {
  if (++count_ > kMostFaults) return;
  const auto line = where != nullptr ? where->source().begin.line : 0;
  text_ += fmt::format("{}{}:{}: {}: {}", text_.empty() ? "" : "\n", file_, line, key, what);
}

std::string TomlSection::path_of(std::string_view key) const {
  if (key.empty()) return name_;
  return name_.empty() ? std::string(key) : fmt::format("{}.{}", name_, key);
}

const toml::node* TomlSection::find(std::string_view key) {
  known_.emplace(key);
  return table_ == nullptr ? nullptr : table_->get(key);
}

void TomlSection::fault(std::string_view key, std::string_view what) {
  const toml::node* where = table_ == nullptr || key.empty() ? nullptr : table_->get(key);
  faults_.add(where != nullptr ? where : where_, path_of(key), what);
}

TomlSection TomlSection::child(std::string_view key) {
  const toml::node* node = find(key);
  if (node != nullptr && !node->is_table()) fault(key, "must be a table");
  return {node != nullptr ? node->as_table() : nullptr, path_of(key), faults_, where_};
}

std::vector<std::string> TomlSection::keys() const {
  std::vector<std::string> keys;
  if (table_ == nullptr) return keys;
  for (const auto& [key, value] : *table_) keys.emplace_back(key.str());
  return keys;
}

std::vector<TomlSection> TomlSection::children(std::string_view key) {
  std::vector<TomlSection> sections;
  const toml::node* node = find(key);
  if (node == nullptr) return sections;
  const toml::array* array = node->as_array();

  if (array == nullptr) {
    fault(key, "must be an array of tables");
    return sections;
  }

  for (const toml::node& element : *array) {
    if (element.is_table()) {
      sections.emplace_back(element.as_table(), path_of(key), faults_);
    } else {
      fault(key, "must be an array of tables");
    }
  }

  return sections;
}

bool TomlSection::number(std::string_view key, double& value, double scale, NumberRange range) {
  const toml::node* node = find(key);
  if (node == nullptr) return false;
  const std::optional<double> seen = node->value<double>();

  if (!node->is_number() || !seen || !std::isfinite(*seen)) {
    fault(key, "must be a number");
    return false;
  }

  if (*seen < range.least || *seen > range.most) {
    fault(key, fmt::format("{} is out of range {} to {}", *seen, range.least, range.most));
    return false;
  }

  value = *seen * scale;
  return true;
}

bool TomlSection::integer(std::string_view key, std::int64_t& value, std::int64_t least,
                          std::int64_t most) {
  const toml::node* node = find(key);
  if (node == nullptr) return false;
  const auto* seen = node->as_integer();
  if (seen == nullptr || seen->get() < least || seen->get() > most) {
    fault(key, fmt::format("must be a whole number from {} to {}", least, most));
    return false;
  }
  value = seen->get();
  return true;
}

bool TomlSection::port(std::string_view key, std::uint16_t& value) {
  std::int64_t seen = 0;
  if (!integer(key, seen, 0, kLastPort)) return false;
  value = static_cast<std::uint16_t>(seen);
  return true;
}

bool TomlSection::text(std::string_view key, std::string& value) {
  const toml::node* node = find(key);
  if (node == nullptr) return false;
  if (!node->is_string()) {
    fault(key, "must be a string");
    return false;
  }
  value = node->as_string()->get();
  return true;
}

bool TomlSection::flag(std::string_view key, bool& value) {
  const toml::node* node = find(key);
  if (node == nullptr) return false;
  if (!node->is_boolean()) {
    fault(key, "must be true or false");
    return false;
  }
  value = node->as_boolean()->get();
  return true;
}

bool TomlSection::duration(std::string_view key, std::chrono::nanoseconds& value, double scale) {
  double seconds = 0.0;
  if (!number(key, seconds, scale, kNotNegativeNumber)) return false;
  value = seconds_to_ns(seconds);
  return true;
}

bool TomlSection::vector(std::string_view key, Eigen::Vector3d& value, double scale) {
  const toml::node* node = find(key);
  if (node == nullptr) return false;
  const toml::array* array = node->as_array();
  Eigen::Vector3d seen = Eigen::Vector3d::Zero();
  bool good = array != nullptr && array->size() == 3;

  for (std::size_t i = 0; good && i < 3; ++i) {
    const std::optional<double> number = array->get(i)->value<double>();
    good = array->get(i)->is_number() && number && std::isfinite(*number);
    if (good) seen[static_cast<Eigen::Index>(i)] = *number;
  }

  if (!good) {
    fault(key, "must be three numbers, x, y, z");
    return false;
  }

  value = scale * seen;
  return true;
}

void TomlSection::refuse_unknown_keys() {
  if (table_ == nullptr) return;
  for (const auto& [key, node] : *table_) {
    if (known_.find(key.str()) == known_.end())
      faults_.add(&node, path_of(key.str()), unknown(key.str()));
  }
}

std::string TomlSection::unknown(std::string_view key) const {
  const std::string similar = protocol::suggestion(key, {known_.begin(), known_.end()});
  return "unknown key" +
         (similar.empty() ? fmt::format("; the keys of this table are {}", fmt::join(known_, ", "))
                          : similar);
}

Result<toml::table> parse_toml(std::string_view text, const std::string& file) {
  constexpr protocol::TomlBounds kBounds;
  if (text.size() > kBounds.bytes)
    return bad_input(
        fmt::format("{}: {} bytes, at most {} are read", file, text.size(), kBounds.bytes));

  if (const auto at = protocol::toml_deeper_than(text, kBounds.depth)) {
    const auto line = 1 + std::ranges::count(text.substr(0, *at), '\n');
    return bad_input(fmt::format("{}:{}: nested deeper than {}", file, line, kBounds.depth));
  }

  try {
    return toml::parse(text, file);
  } catch (const toml::parse_error& e) {
    return bad_input(fmt::format("{}:{}: {}", file, e.source().begin.line, e.description()));
  }
}

Result<void> read_toml_file(const std::string& file,
                            const std::function<void(TomlSection)>& reader) {
  const auto text = read_file(file);
  ABBE_TRY(text);
  const auto table = parse_toml(*text, file);
  ABBE_TRY(table);
  TomlFaults faults(file);
  reader(TomlSection(&*table, "", faults));
  if (faults.any()) return tl::unexpected(faults.error());
  return {};
}

}  // namespace abbe::sim
