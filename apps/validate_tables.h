// The tables of the paper that validate reruns.
#pragma once
