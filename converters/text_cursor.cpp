#include "converters/text_cursor.h"

#include <fmt/format.h>
#include <locale.h>
#include <stdlib.h>

#include <charconv>
#include <utility>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

/// std::from_chars knows no plus sign.
std::string_view without_plus(std::string_view word) {
    const bool plus = word.size() > 1 && word[0] == '+' && word[1] != '-';
    return plus ? word.substr(1) : word;
}

/// A number whose size no normal one has: zero, a denormal or an infinity, whatever the locale.
template <class T>
T extreme_number(std::string_view word) {
    static const locale_t c_locale = ::newlocale(LC_ALL_MASK, "C", nullptr);
    const std::string text(word);
    if constexpr (sizeof(T) == sizeof(float)) return ::strtof_l(text.c_str(), nullptr, c_locale);
    return static_cast<T>(::strtod_l(text.c_str(), nullptr, c_locale));
}

template <class T>
T floating(const TextCursor& at, std::string_view found, const char* what) {
    const std::string_view digits = without_plus(found);
    T value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    const bool whole = !digits.empty() && end == digits.data() + digits.size();
    if (whole && error == std::errc()) return value;
    if (whole && error == std::errc::result_out_of_range) return extreme_number<T>(digits);
    if (found.empty()) at.fail(fmt::format("{} is missing", what));
    at.fail(fmt::format("{}: expected a number, found {}", what, in_quotes(found)));
}

}  // namespace

std::string in_quotes(std::string_view word) {
    constexpr std::size_t longest = 40;
    std::string text = "'";
    for (const char c : word.substr(0, longest)) text += c >= ' ' && c <= '~' ? c : '.';
    return text + (word.size() > longest ? "…'" : "'");
}

TextCursor::TextCursor(std::string_view text, std::string file, char comment, std::size_t line)
    : begin_(text.data()),
      at_(begin_),
      end_(begin_ + text.size()),
      file_(std::move(file)),
      comment_(comment),
      line_(line) {
    if (text.substr(0, 3) == "\xEF\xBB\xBF") at_ += 3;  // a byte order mark
}

void TextCursor::skip_line() {
    while (!at_line_end()) ++at_;
}

bool TextCursor::next_line() {
    if (std::exchange(started_, true)) skip_line();
    while (at_ != end_) {
        if (at_blank()) {
            ++at_;
        } else if (at_line_end()) {
            const bool pair = *at_ == '\r' && end_ - at_ > 1 && at_[1] == '\n';
            at_ += pair ? 2 : 1;
            ++line_;
        } else if (comment_ != '\0' && *at_ == comment_) {
            skip_line();
        } else {
            return true;
        }
    }
    return false;
}

std::string_view TextCursor::word() {
    while (at_ != end_ && at_blank()) ++at_;
    const char* const first = at_;
    if (comment_ != '\0' && at_ != end_ && *at_ == comment_) skip_line();
    if (at_ != first) return {};
    while (!at_line_end() && !at_blank() && (comment_ == '\0' || *at_ != comment_)) ++at_;
    return {first, static_cast<std::size_t>(at_ - first)};
}

std::string_view TextCursor::next_word() {
    for (;;) {
        if (const std::string_view found = word(); !found.empty()) return found;
        if (!next_line()) return {};
    }
}

void TextCursor::expect_line_end() {
    if (const std::string_view more = word(); !more.empty())
        fail(fmt::format("expected the end of the line, found {}", in_quotes(more)));
}

float TextCursor::number(const char* what) { return number_in(word(), what); }

float TextCursor::number_in(std::string_view found, const char* what) const {
    return floating<float>(*this, found, what);
}

double TextCursor::real(const char* what) { return real_in(word(), what); }

double TextCursor::real_in(std::string_view found, const char* what) const {
    return floating<double>(*this, found, what);
}

std::int64_t TextCursor::integer(const char* what) {
    const std::string_view found = word();
    if (found.empty()) fail(fmt::format("{} is missing", what));
    return integer_in(found, what);
}

std::int64_t TextCursor::integer_in(std::string_view text, const char* what) const {
    const std::string_view digits = without_plus(text);
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error != std::errc() || end != digits.data() + digits.size())
        fail(fmt::format("{}: expected a whole number, found {}", what, in_quotes(text)));
    return value;
}

void TextCursor::fail(const std::string& message) const {
    throw InvalidInput(fmt::format("{}: line {}: {}", file_, line_, message));
}

}  // namespace vdbgeo
