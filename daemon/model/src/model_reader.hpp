#pragma once

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"
#include "decimal.hpp"
#include "model_format.hpp"

namespace abbe::daemon {

/// Numbers are long double: see decimal.hpp.
using ModelJson = nlohmann::basic_json<std::map, std::vector, std::string, bool, std::int64_t,
                                       std::uint64_t, long double>;

/// Reads values by their path in the JSON text. For a value that cannot be read, a fault is added
/// and a default value is returned; the first 20 faults are kept.
class ModelReader {
 public:
  ModelReader(const ModelJson& root, std::string file) : root_(root), file_(std::move(file)) {}

  void fault(std::string_view path, std::string_view what) {
    constexpr std::size_t kShown = 20;
    if (faults_.size() < kShown) faults_.push_back(fmt::format("{}: {}: {}", file_, path, what));
  }
  [[nodiscard]] bool any() const noexcept { return !faults_.empty(); }
  [[nodiscard]] Error to_error() const {
    return {ErrorCode::BadInput, fmt::format("{}: not a valid model", file_), faults_};
  }

  const ModelJson* find(const ModelJson& in, const std::string& path, const std::string& key) {
    if (in.is_object() && in.contains(key)) return &in.at(key);
    fault(path.empty() ? key : path + "." + key, "missing");
    return nullptr;
  }
  [[nodiscard]] bool has(const std::string& key) const {
    return root_.is_object() && root_.contains(key);
  }
  std::string text(const std::string& key) { return text_of(root_, "", key); }
  std::string text_of(const ModelJson& in, const std::string& path, const std::string& key) {
    const ModelJson* value = find(in, path, key);
    if (value == nullptr) return {};
    if (!value->is_string()) fault(path.empty() ? key : path + "." + key, "must be a string");
    return value->is_string() ? value->get<std::string>() : std::string{};
  }
  double number(const ModelJson& value, const std::string& path, int shift) {
    if (!value.is_number()) {
      fault(path, "must be a number");
      return 0.0;
    }
    const double si = from_decimal(value.get<long double>(), shift);
    if (!std::isfinite(si)) fault(path, "out of range");
    return si;
  }
  double number_of(const ModelJson& in, const std::string& path, const std::string& key,
                   int shift) {
    const ModelJson* value = find(in, path, key);
    return value == nullptr ? 0.0 : number(*value, path + "." + key, shift);
  }
  /// The number `key` of `in`, in SI. Adds a fault if it is not between `least` and `most`, both in
  /// SI.
  double number_within(const ModelJson& in, const std::string& path, const std::string& key,
                       int shift, double least, double most) {
    const ModelJson* value = find(in, path, key);
    if (value == nullptr) return least;
    const double si = number(*value, path + "." + key, shift);
    if (std::isfinite(si) && (si < least || si > most))
      fault(path + "." + key, fmt::format("is not plausible: {}", to_decimal(si, shift)));
    return si;
  }
  std::size_t count_of(const ModelJson& in, const std::string& path, const std::string& key) {
    const ModelJson* value = find(in, path, key);
    if (value == nullptr) return 0;
    if (!value->is_number_unsigned()) fault(path + "." + key, "must be a whole number");
    return value->is_number_unsigned() ? value->get<std::size_t>() : 0;
  }
  std::vector<double> numbers(const ModelJson& value, const std::string& path, int shift) {
    std::vector<double> result;
    if (!value.is_array()) fault(path, "must be an array of numbers");
    if (value.is_array())
      for (const auto& element : value) result.push_back(number(element, path, shift));
    return result;
  }
  calib::Vector3 vector_um(const ModelJson& in, const std::string& path, const std::string& key) {
    const ModelJson* value = find(in, path, key);
    if (value == nullptr) return calib::Vector3::Zero();
    const auto v = numbers(*value, path + "." + key, kMicroUnit);
    if (v.size() == 3) return {v[0], v[1], v[2]};
    fault(path + "." + key, "must be [x, y, z]");
    return calib::Vector3::Zero();
  }
  std::vector<calib::Vector3> vectors(const ModelJson* value, const std::string& path) {
    std::vector<calib::Vector3> result;
    if (value == nullptr) return result;
    if (!value->is_array()) fault(path, "must be an array of [x, y, z]");
    if (value->is_array())
      for (const auto& element : *value) {
        const auto v = numbers(element, path, kMm);
        if (v.size() == 3)
          result.emplace_back(v[0], v[1], v[2]);
        else
          fault(path, "every element must be [x, y, z]");
      }
    return result;
  }
  [[nodiscard]] const ModelJson& root() const noexcept { return root_; }

 private:
  const ModelJson& root_;
  std::string file_;
  std::vector<std::string> faults_;
};

}  // namespace abbe::daemon
