#include "vdbgeo/core/run_together.h"

#include <new>
#include <string>

#include "vdbgeo/core/errors.h"

namespace vdbgeo {
namespace {

enum Failure : char { input = 'i', io = 'o', numerical = 'n', cancelled = 'c', memory = 'm', other = 'x' };

/// What a step threw, as its kind and its message; empty where it went well.
std::string failure_of(const std::function<void()>& step) {
    try {
        step();
        return {};
    } catch (const InvalidInput& e) {
        return char(input) + std::string(e.what());
    } catch (const IoError& e) {
        return char(io) + std::string(e.what());
    } catch (const NumericalError& e) {
        return char(numerical) + std::string(e.what());
    } catch (const Cancelled&) {
        return {char(cancelled)};
    } catch (const std::bad_alloc&) {
        return {char(memory)};
    } catch (const std::exception& e) {
        return char(other) + std::string(e.what());
    }
}

[[noreturn]] void throw_again(char kind, const std::string& message) {
    switch (kind) {
        case input:
            throw InvalidInput(message);
        case io:
            throw IoError(message);
        case numerical:
            throw NumericalError(message);
        case cancelled:
            throw Cancelled();
        case memory:
            throw std::bad_alloc();
        default:
            throw std::runtime_error(message);
    }
}

}  // namespace

void run_together(Team& team, const std::function<void()>& step) {
    const std::string mine = failure_of(step);
    for (const std::vector<char>& failure : team.gather({mine.begin(), mine.end()}))
        if (!failure.empty()) throw_again(failure[0], {failure.begin() + 1, failure.end()});
}

}  // namespace vdbgeo
