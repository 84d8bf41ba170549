#include "abbe/sections/section.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "abbe/protocol/printable.hpp"

namespace abbe::sections {

namespace {

std::string bounds_text(Bounds bounds) {
  if (bounds.min == kPositive.min) return "must be positive";
  if (std::isinf(bounds.max)) return fmt::format("must be at least {}", bounds.min);
  return fmt::format("must be {} to {}", bounds.min, bounds.max);
}

std::string type_text(const toml::node& node) {
  if (node.is_string()) return "a string";
  if (node.is_boolean()) return "true or false";
  if (node.is_array()) return "an array";
  if (node.is_table()) return "a table";
  if (node.is_number()) return "a number";
  return "a date or time";
}

std::optional<double> number_in(const toml::node& node) {
  if (!node.is_number()) return std::nullopt;
  return node.value<double>();
}

}  // namespace

Section::Section(const toml::table* table, std::string path, toml::source_position where,
                 Faults& faults, Origin origin)
    : table_(table), path_(std::move(path)), where_(where), faults_(&faults), origin_(origin) {}

std::string Section::full(std::string_view key) const {
  if (path_.empty()) return std::string{key};
  return key.empty() ? path_ : fmt::format("{}.{}", path_, key);
}

void Section::fault_at(toml::source_position at, std::string_view key, std::string_view what) {
  faults_->add(at.line, at.column, full(key), what);
}

void Section::fault(std::string_view key, std::string_view what) {
  const toml::node* node = table_ != nullptr ? table_->get(key) : nullptr;
  fault_at(node != nullptr ? node->source().begin : where_, key, what);
}

void Section::implausible(std::string_view key, std::string_view what) {
  if (origin_ == Origin::Written) fault(key, what);
}

bool Section::has(std::string_view key) const {
  known_.emplace_back(key);
  return table_ != nullptr && table_->contains(key);
}

const toml::node* Section::node(std::string_view key) const {
  return has(key) ? table_->get(key) : nullptr;
}

std::vector<std::string> Section::keys() const {
  std::vector<std::string> result;
  if (table_ == nullptr) return result;
  for (const auto& [key, node] : *table_) result.emplace_back(key.str());
  return result;
}

const toml::node* Section::find(std::string_view key, Need need) {
  if (has(key)) return table_->get(key);
  if (need == Need::Required) fault_at(where_, key, "missing");
  return nullptr;
}

Section Section::child(std::string_view key, Need need) {
  const toml::node* node = find(key, need);
  if (node != nullptr && !node->is_table()) {
    fault_at(node->source().begin, key, fmt::format("must be a table, not {}", type_text(*node)));
    node = nullptr;
  }
  const auto where = node != nullptr ? node->source().begin : where_;
  return {node != nullptr ? node->as_table() : nullptr, full(key), where, *faults_, origin_};
}

std::vector<Section> Section::children(std::string_view key) {
  std::vector<Section> result;
  const toml::node* node = find(key, Need::Optional);
  if (node == nullptr) return result;

  if (!node->is_array()) {
    fault_at(node->source().begin, key,
             fmt::format("must be an array of tables, not {}", type_text(*node)));
    return result;
  }

  std::size_t index = 0;
  for (const auto& element : *node->as_array()) {
    const auto name = fmt::format("{}[{}]", key, index++);
    if (element.is_table())
      result.emplace_back(element.as_table(), full(name), element.source().begin, *faults_,
                          origin_);
    else
      fault_at(element.source().begin, name,
               fmt::format("must be a table, not {}", type_text(element)));
  }

  return result;
}

bool Section::get(std::string_view key, double& out, Unit unit, Bounds bounds, Need need) {
  const toml::node* node = find(key, need);
  if (node == nullptr) return false;
  const auto value = number_in(*node);

  if (!value) {
    fault_at(node->source().begin, key, fmt::format("must be a number, not {}", type_text(*node)));
    return false;
  }

  if (!std::isfinite(*value)) {
    fault_at(node->source().begin, key, "must be finite");
    return false;
  }

  if (*value < bounds.min || *value > bounds.max) {
    fault_at(node->source().begin, key, fmt::format("{}, not {}", bounds_text(bounds), *value));
    return false;
  }

  out = *value / unit.per_si;
  return true;
}

bool Section::get(std::string_view key, std::chrono::nanoseconds& out, Unit unit, Bounds bounds,
                  Need need) {
  double seconds = 0.0;
  // At most a century, because the conversion to int64 nanoseconds must not overflow.
  bounds.max = std::min(bounds.max, 3.15e9 * unit.per_si);
  if (!get(key, seconds, unit, bounds, need)) return false;
  out = std::chrono::nanoseconds{std::llround(seconds * kNano.per_si)};
  return true;
}

bool Section::get(std::string_view key, std::string& out, Need need) {
  const toml::node* node = find(key, need);
  if (node == nullptr) return false;
  const auto value = node->value_exact<std::string>();
  if (!value || value->empty()) {
    fault_at(
        node->source().begin, key,
        value ? "must not be empty" : fmt::format("must be a string, not {}", type_text(*node)));
    return false;
  }
  check_characters(key, *value);
  out = *value;
  return true;
}

void Section::check_characters(std::string_view key, std::string_view value) {
  const auto is_control = [](char c) {
    return (c >= 0 && c < ' ' && c != '\n' && c != '\t') || c == '\x7f';
  };
  const auto found = std::ranges::find_if(value, is_control);
  if (found != value.end())
    implausible(key, fmt::format("contains {}", protocol::strange_character({&*found, 1})));
}

bool Section::get_maybe_empty(std::string_view key, std::string& out) {
  const toml::node* node = find(key, Need::Optional);
  const bool empty = node != nullptr && node->value_exact<std::string>() == std::string{};
  if (!empty) return get(key, out);
  out.clear();
  return true;
}

bool Section::get(std::string_view key, bool& out, Need need) {
  const toml::node* node = find(key, need);
  if (node == nullptr) return false;
  const auto value = node->value_exact<bool>();
  if (!value)
    fault_at(node->source().begin, key,
             fmt::format("must be true or false, not {}", type_text(*node)));
  else
    out = *value;
  return value.has_value();
}

bool Section::get(std::string_view key, std::vector<double>& out, Unit unit, Need need) {
  const toml::node* node = find(key, need);
  if (node == nullptr) return false;
  const toml::array* array = node->as_array();

  if (array == nullptr) {
    fault_at(node->source().begin, key,
             fmt::format("must be an array of numbers, not {}", type_text(*node)));
    return false;
  }

  std::vector<double> values;
  for (const auto& element : *array) {
    const auto value = number_in(element);
    if (value && std::isfinite(*value))
      values.push_back(*value / unit.per_si);
    else
      fault_at(element.source().begin, key, "every element must be a finite number");
  }

  if (values.size() != array->size()) return false;
  out = std::move(values);
  return true;
}

bool Section::get(std::string_view key, std::vector<std::string>& out) {
  const toml::node* node = find(key, Need::Optional);
  if (node == nullptr) return false;
  const toml::array* array = node->as_array();
  std::vector<std::string> values;
  if (array != nullptr)
    for (const auto& element : *array)
      if (const auto value = element.value_exact<std::string>()) values.push_back(*value);
  for (const auto& value : values) check_characters(key, value);

  if (array == nullptr || values.size() != array->size()) {
    fault_at(node->source().begin, key, "must be an array of strings");
    return false;
  }

  out = std::move(values);
  return true;
}

bool Section::get(std::string_view key, std::filesystem::path& out,
                  const std::filesystem::path& base) {
  std::string text;
  if (!get(key, text)) return false;
  out = base / text;  // an absolute `text` replaces the base
  return true;
}

bool Section::take_integer(std::string_view key, std::int64_t& out, std::int64_t min,
                           std::int64_t max, Need need) {
  const toml::node* node = find(key, need);
  if (node == nullptr) return false;
  const auto value = node->value_exact<std::int64_t>();
  if (!value || *value < min || *value > max) {
    fault_at(node->source().begin, key, fmt::format("must be a whole number, {} to {}", min, max));
    return false;
  }
  out = *value;
  return true;
}

bool Section::take_word(std::string_view key, std::size_t& out,
                        const std::vector<std::string_view>& words, std::size_t current,
                        Need need) {
  const toml::node* node = find(key, need);
  if (node == nullptr) return false;
  const auto value = node->value_exact<std::string>();
  const auto found = value ? std::find(words.begin(), words.end(), *value) : words.end();
  if (found == words.end()) {
    const std::vector<std::string_view> named(words.begin(),
                                              words.begin() + static_cast<std::ptrdiff_t>(current));
    fault_at(node->source().begin, key,
             fmt::format("must be one of \"{}\"{}", fmt::join(named, "\", \""),
                         value ? protocol::suggestion(*value, named) : ""));
    return false;
  }
  out = static_cast<std::size_t>(found - words.begin());
  return true;
}

void Section::close(Hint hint) {
  if (table_ == nullptr) return;
  const std::set<std::string_view> known(known_.begin(), known_.end());
  for (const auto& [key, node] : *table_) {
    if (known.contains(key.str())) continue;
    std::string more = protocol::suggestion(key.str(), {known_.begin(), known_.end()});
    if (more.empty() && hint == Hint::AllKeys)
      more = fmt::format("; the keys of this table are {}", fmt::join(known, ", "));
    fault_at(key.source().begin, key.str(), "unknown key" + more);
  }
}

}  // namespace abbe::sections
